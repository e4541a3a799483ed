// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <cstddef>
#include <map>

namespace vgtw {

struct FilterOptions {
  // An observation that reprojects farther than this (pixels) is removed; > 0.
  double max_reprojection_error_px = 4.0;
  // A point stays if the rays of some pair of its observations meet at this angle; in [0, 90).
  double min_triangulation_angle_deg = 1.5;
  std::map<ImageId, double> max_reprojection_error_px_by_image = {};  // where another limit holds

  void Check() const;
};

struct FilterSummary {
  size_t num_removed_observations = 0;  // those of removed points included
  size_t num_removed_points3D = 0;
};

// Removes observations that are behind their camera or reproject worse than the limit, and points
// that keep fewer than two observations or no pair of rays at the minimum angle.
FilterSummary FilterObservations(const FilterOptions& options, Reconstruction& reconstruction);

}  // namespace vgtw
