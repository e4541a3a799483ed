// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "scene/image_io.h"
#include "scene/view.h"

#include <cstddef>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What seeds, clouds and depth maps share when they take depths from predictions.

struct StaticDepthFilter {
  // Share of the depths that is kept, the most confident of all views together, in percent,
  // (0, 100]; taken before the distractor test, as VGTW's authors do.
  double keep_percent = 50.0;
  // A pixel with at least this distractor probability has no depth; in (0, 1].
  double distractor_threshold = 0.5;

  void Check() const;
};

// The confidence from which `keep_percent` of all known depths of these views are kept.
double PooledConfidenceThreshold(const PredictionReader& predictions,
                                 const std::vector<size_t>& view_idxs,
                                 double keep_percent,
                                 int num_threads);

// The photo of a view. Throws Error if it is missing or not of the size that was predicted from.
RgbImage ReadPhotoOf(const View& view, const std::filesystem::path& image_folder);

// Gray outside of the photo, and everywhere where it is empty.
Rgb ColorAt(const RgbImage& photo, const Eigen::Vector2d& pixel_in_original);

}  // namespace vgtw
