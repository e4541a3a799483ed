// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <cstddef>
#include <optional>
#include <span>

namespace vgtw {

// What the bytes of an image file say before any pixel is decoded. The bytes are foreign: every
// function is defined for any input, including an empty one.

// Size of a JPEG (first frame header) or PNG (IHDR); nullopt for other or damaged files.
std::optional<ImageSize> ParseImageSize(std::span<const std::byte> file);

enum class PngColour { kGray = 0, kRgb = 2, kPalette = 3, kGrayWithAlpha = 4, kRgbWithAlpha = 6 };

struct PngFormat {
  int bit_depth = 0;  // of a channel, or of an index into the palette: 1, 2, 4, 8 or 16
  PngColour colour = PngColour::kGray;
};

// What a PNG's header says of its pixels; nullopt for other or damaged files.
std::optional<PngFormat> ParsePngFormat(std::span<const std::byte> file);

// Whether a PNG has an alpha channel that the Python imaging library keeps when it opens the file:
// RGB with alpha, and gray with alpha of 16 bits, but not of 8.
bool HasAlphaForPython(std::span<const std::byte> file);

// Whether a JPEG or PNG ends before its end marker (EOI, IEND). Decoders fill the rest of such a
// JPEG with grey without a word. False for other formats. Bytes behind the end marker are allowed,
// because phones append thumbnails and videos there.
bool IsTruncated(std::span<const std::byte> file);

// The APP1 payload of a JPEG that starts with "Exif\0\0", or an empty span.
std::span<const std::byte> FindExif(std::span<const std::byte> file);

}  // namespace vgtw
