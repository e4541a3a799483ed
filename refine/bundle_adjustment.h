// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <functional>
#include <string>

namespace vgtw {

enum class RobustLoss { kTrivial, kHuber, kCauchy };

struct BundleAdjustmentOptions {
  RobustLoss loss = RobustLoss::kCauchy;
  // Residual (pixels) at which the loss departs from the square; > 0.
  double loss_scale_px = 1.0;
  bool refine_poses = true;
  bool refine_focal_length = true;
  bool refine_principal_point = false;
  bool refine_extra_params = false;
  int max_num_iterations = 50;
  int num_threads = 0;  // 0 = all cores
  // Called after each iteration with (iteration, cost); returning false stops and keeps the best.
  std::function<bool(int, double)> on_iteration;

  void Check() const;
};

struct BundleAdjustmentSummary {
  bool success = false;  // the solution is usable
  std::string message;   // the solver's word
  size_t num_residuals = 0;
  double initial_cost = 0.0;  // robust cost
  double final_cost = 0.0;
  int num_iterations = 0;
  std::string gauge;  // which images fix the gauge, in words
};

// Minimises  sum rho(|project(camera, cam_from_world * X) - point2D|^2)  over the static points,
// poses and intrinsics. Gauge: the pose of one image and one coordinate of the centre of the image
// farthest from it are held (7 degrees of freedom). Observations behind a camera take no part.
// If the solver fails, or the cost grows, the reconstruction is left as it was.
BundleAdjustmentSummary AdjustBundle(const BundleAdjustmentOptions& options,
                                     Reconstruction& reconstruction);

struct FilterOptions {
  double max_reprojection_error_px = 4.0;  // > 0
  double min_triangulation_angle_deg = 1.5;
};
struct FilterSummary {
  size_t num_removed_observations = 0;
  size_t num_removed_points3D = 0;
};

// Removes observations that are behind their camera or reproject worse than the limit, and points
// that keep fewer than two observations or no pair of rays at the minimum angle.
FilterSummary FilterObservations(const FilterOptions& options, Reconstruction& reconstruction);

}  // namespace vgtw
