// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/point_tree.h"
#include "scene/sim3d.h"

#include <cstddef>
#include <optional>

namespace vgtw {

struct IcpOptions {
  // Pairs of points farther apart (scene units of the target) do not count; > 0.
  double max_distance = 0.1;
  // Also the scale is found, from the nearest points in both directions: in one alone, a cloud that
  // shrinks into a corner of the other would be the best answer.
  bool with_scale = false;
  int max_iterations = 30;
  // Ends when the share of points with a pair, and their RMSE, change by less.
  double min_change = 1e-6;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

struct IcpResult {
  Sim3d target_from_source;
  double share_paired = 0.0;  // of the source's points; with scale, of both clouds' points
  double rmse = 0.0;          // of the pairs, scene units of the target
  int num_iterations = 0;
  bool converged = false;
};

// Iterative closest points, point to point, from a first guess, whose scale is kept unless
// `with_scale`. Limits, criterion and defaults are those of Open3D's registration_icp, which the
// evaluations of CUT3R and pi3 call. The same on any number of threads.
// Returns nullopt if the pairs at some step do not determine a motion (none, or collinear).
std::optional<IcpResult> AlignByIcp(const PointTree& source,
                                    const PointTree& target,
                                    const Sim3d& target_from_source,
                                    const IcpOptions& options = {});

}  // namespace vgtw
