// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/grid.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

using Rgb = std::array<uint8_t, 3>;
using RgbImage = Grid<Rgb>;
using GrayImage = Grid<uint8_t>;

struct ImageSize {
  uint64_t width = 0;
  uint64_t height = 0;
  bool operator==(const ImageSize&) const = default;
};

// Pixels exactly as COLMAP sees the file: stored orientation (EXIF orientation NOT applied), 8 bit.
// Alpha is dropped. Throws Error if the file is missing, not an image, truncated, or has more than
// 2^30 pixels.
RgbImage ReadRgbImage(const std::filesystem::path& path);

// The same pixels on a white ground, as the loaders of the networks see them: where a PNG has an
// alpha channel that the Python imaging library composites (RGB with alpha, 16-bit gray with
// alpha), each channel is value * alpha + 255 * (1 - alpha), rounded; every other file reads as by
// ReadRgbImage. Bit-equal to that library, but for TIFFs with alpha, gray PNGs of 16 bits, which it
// turns white, and CMYK JPEGs, which differ by 1.
RgbImage ReadRgbImageOnWhite(const std::filesystem::path& path);

// The pixels of ReadRgbImage as the gray values in which COLMAP looks for features: luma of Rec.
// 709, rounded. Throws as that does.
GrayImage ReadGrayImage(const std::filesystem::path& path);

// Size from the file's header only where the format allows (JPEG, PNG), else by decoding.
ImageSize ReadImageSize(const std::filesystem::path& path);

// The gray values of a mask file as COLMAP reads it: luma of colours, alpha dropped. Throws Error
// as above, and for 16-bit files, which COLMAP 3.8 refuses.
GrayImage ReadMaskValues(const std::filesystem::path& path);

// The same as a mask: any non-zero value is kept (255).
StaticMask ReadStaticMask(const std::filesystem::path& path);

// The alpha channel in 8 bits; nullopt if the file has none, or more than 8 bits a channel.
std::optional<GrayImage> ReadAlpha(const std::filesystem::path& path);

// 8-bit PNG (or JPEG by extension), written atomically; parent folders are created.
void WriteImage(const std::filesystem::path& path, const RgbImage& image);
void WriteImage(const std::filesystem::path& path, const GrayImage& image);

// The bytes of a JPEG file; `quality` in [1, 100].
std::vector<std::byte> EncodeJpeg(const RgbImage& image, int quality);

// Focal length in pixels by COLMAP's default rule, from a JPEG's EXIF: 35-mm equivalent / 35 *
// max(width, height); else FocalLength, rounded to 0.1 mm as COLMAP 3.8 does, over the sensor's
// width (PixelXDimension / FocalPlaneXResolution, per inch or cm) * max(width, height); nullopt
// where neither is given. Between the two COLMAP looks into its table of sensors, which is not part
// of this project; in the end it falls back to 1.2 * max(width, height). Never throws for damaged
// EXIF.
std::optional<double> ReadExifFocalLength(const std::filesystem::path& path, const ImageSize& size);

// Names of the images below `folder`, recursively, relative with '/', sorted byte-wise; extensions
// that COLMAP reads (jpg jpeg png tif tiff bmp ppm pgm, any case). Hidden files are left out.
// Throws Error if the folder is missing or holds no image.
std::vector<std::string> ListImages(const std::filesystem::path& folder);

}  // namespace vgtw
