// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/bundle_priors.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <functional>
#include <limits>
#include <set>
#include <string>

namespace vgtw {

enum class RobustLoss { kTrivial, kHuber, kCauchy };

struct BundleAdjustmentOptions {
  RobustLoss loss = RobustLoss::kCauchy;
  // Residual (pixels) at which the loss departs from the square; > 0.
  double loss_scale_px = 1.0;
  bool refine_poses = true;
  std::set<ImageId> fixed_images;  // images whose pose is held; they still observe points
  bool refine_focal_length = true;
  bool refine_principal_point = false;
  bool refine_extra_params = false;
  BundlePriors priors;
  int max_num_iterations = 50;
  // Done when an iteration lowers the cost by less than this share; in [0, 1).
  double function_tolerance = 1e-9;
  // No iteration begins later; what was reached until then is kept.
  double max_seconds = std::numeric_limits<double>::infinity();
  int num_threads = 0;  // 0 = all cores
  // Called with (iteration, cost) at the start and after each iteration; returning false stops and
  // keeps the best.
  std::function<bool(int, double)> on_iteration;

  void Check() const;
};

struct BundleAdjustmentSummary {
  bool success = false;       // the solution is usable and was written to the reconstruction
  std::string message;        // the solver's word, or why nothing was done
  size_t num_residuals = 0;   // two per observation, and those of priors
  double initial_cost = 0.0;  // half the sum of the robust losses, pixels^2
  double final_cost = 0.0;
  int num_iterations = 0;
  double total_sec = 0.0;          // wall time, with setting up and writing back
  double evaluation_sec = 0.0;     // of residuals and derivatives
  double linear_solver_sec = 0.0;  // of steps
  std::string gauge;               // which images fix the gauge, in words
  BundlePriorsSummary priors;
};

// Minimises  sum rho(|project(camera, cam_from_world * X) - point2D|^2)  over the points, poses and
// intrinsics. Observations that are behind their camera at the start, and points that fewer than
// two images then observe, take no part; images with fewer than 3 observations keep their pose.
// Gauge, per group of images linked by common points: the pose of one image and one coordinate of
// the translation of the image farthest from it (7 degrees of freedom), see refine/gauge.h. Priors
// in a world of their own link groups, since their similarity is one for all; priors in the model's
// world (PriorWorld::kSame) take the place of the gauge in the groups that they determine.
// Afterwards frames and point errors are up to date. If there is nothing to adjust, the solver
// fails, or the cost grows, the reconstruction is left as it was.
// Throws std::invalid_argument if the reconstruction breaks its law.
BundleAdjustmentSummary AdjustBundle(const BundleAdjustmentOptions& options,
                                     Reconstruction& reconstruction);

}  // namespace vgtw
