// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/features.h"
#include "scene/image_io.h"

#include <cstdint>

namespace vgtw {

// COLMAP's defaults where it has the option.
struct SiftOptions {
  // An image whose longer side has more pixels is reduced to it; in [1, 16000].
  int max_image_size = 3200;
  // Most rows of the result; >= 1. Unlike COLMAP's, a point with several orientations counts as
  // often.
  int max_num_features = 8192;
  // Extrema of the difference of Gaussians below this contrast are dropped (gray values in [0, 1],
  // three layers an octave); in (0, 1).
  double peak_threshold = 0.02 / 3.0;
  // Most ratio of the principal curvatures of an extremum; > 1.
  double edge_threshold = 10.0;
  // Keypoints up to this many times their scale away from an excluded pixel are dropped, measured
  // between the centres of pixels, because a descriptor looks around itself; >= 0. On photos with
  // people the default leaves 0.3 % of the features contaminated instead of 2.8 % and costs 0.2 %
  // of the clean ones (tests/benchmarks/mask_margin_benchmark).
  double mask_margin_scales = 6.0;

  void Check() const;
};

// SIFT features in COLMAP's conventions, so that they match COLMAP's own: keypoints [rows, 6] in
// pixels of `image`, affine shape scale * rotation, descriptors [rows, 128] as the root of their
// L1-normalised values times 512, rounded, type 0.
// `static_mask` has the size of the image, or is empty: then nothing is excluded. Excluded
// keypoints are dropped before the best max_num_features are chosen, and these are spread over the
// image: each of about 256 cells gives its strongest first, so that no textured corner takes
// everything. Sorted by x, then y; the same on any number of threads. OpenCV's threads are used as
// they are set. Throws std::invalid_argument if the mask has another size.
Features ExtractSift(const GrayImage& image,
                     const StaticMask& static_mask,
                     const SiftOptions& options);

// About how many bytes ExtractSift takes at its peak for an image of this size, the image and its
// mask included.
int64_t SiftMemory(const ImageSize& size, const SiftOptions& options);

}  // namespace vgtw
