// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/image_io.h"
#include "scene/view.h"

#include <cstdint>
#include <string>
#include <vector>

namespace vgtw {

// How photos become the input of a network: byte by byte as the official loaders make it of
// photos that ReadRgbImageOnWhite read. Sizes come from headers alone; then one photo at a time is
// decoded and resized.
struct PreprocessOptions {
  // kCrop is the loader of VGGT's and VGTW's demos, kPad VGGT's other one, kSquarePad that of its
  // COLMAP demo (before that resizes again), kStretch pi3's.
  ResizePolicy policy = ResizePolicy::kCrop;
  // Width of kCrop, side of kPad and kSquarePad; for the first two a multiple of 14.
  int side_px = 518;
  // kStretch: the input has at most so many pixels, at least 14 x 14.
  int64_t max_pixels = 255000;

  // Throws std::invalid_argument naming the field that is out of its range.
  void Check() const;
};

// Where a photo lies in the input. Outside columns first_column .. end_column - 1 and rows
// first_row .. end_row - 1 are the pixels whose centres are not on the photo: bars, about which the
// network's maps say nothing.
struct PhotoPlacement {
  ImageSize photo_size;
  NetworkGeometry geometry;
  int first_column = 0;
  int end_column = 0;
  int first_row = 0;
  int end_row = 0;
};

// Why this photo is no input, or "": empty, or so thin that less than one patch remains of it.
std::string FindFault(const ImageSize& photo_size, const PreprocessOptions& options);

// The placements of all photos in inputs of one size. kStretch takes it from the first photo;
// elsewhere the largest decides, and the others get bars. Throws std::invalid_argument without
// photos or if one has a fault.
std::vector<PhotoPlacement> PlacePhotos(const std::vector<ImageSize>& photo_sizes,
                                        const PreprocessOptions& options);

// The network's input, geometry.network_width x network_height, channels 0 .. 255 (the networks
// take them / 255). Throws std::invalid_argument if `photo` has not the size that was placed.
RgbImage MakeNetworkImage(const RgbImage& photo,
                          const PhotoPlacement& placement,
                          const PreprocessOptions& options,
                          int num_threads = 1);

// A photo's mask as the network's image shows it, resized to the nearest neighbour as the official
// loader of masks does, and `outside` on bars. Not for kSquarePad. Throws std::invalid_argument if
// the mask has not the size of the photo that was placed.
StaticMask MakeNetworkMask(const StaticMask& photo_mask,
                           const PhotoPlacement& placement,
                           const PreprocessOptions& options,
                           uint8_t outside);

}  // namespace vgtw
