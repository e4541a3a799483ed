// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/pose_error.h"

#include <cstddef>
#include <optional>
#include <vector>

namespace vgtw {

struct ErrorStatistics {
  double rmse = 0.0;
  double mean = 0.0;
  double median = 0.0;
  double max = 0.0;
};

// Throws std::invalid_argument if there are none.
ErrorStatistics ComputeErrorStatistics(const std::vector<double>& errors);

// ATE: distances of the camera centres after alignment, scene units of the reference. evo's APE of
// the translation part.
ErrorStatistics ComputeAte(const std::vector<ViewPoseError>& views);

// RPE: per pair (i, i + delta) of views in their order, with world_from_cam of both sets in the
// reference's world (so that scale is that of the alignment),
//   error_i = (Q_i^-1 Q_{i+delta})^-1 (P_i^-1 P_{i+delta}),    Q expected, P estimated,
// of which the length of the translation and the angle of the rotation count. evo's RPE.
// Source: Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012.
struct RpeOptions {
  int delta = 1;          // views, >= 1
  bool all_pairs = true;  // else only i = 0, delta, 2 delta, ...

  void Check() const;
};

struct RelativePoseErrors {
  size_t num_pairs = 0;
  ErrorStatistics translation;   // scene units of the reference
  ErrorStatistics rotation_deg;  // no alignment changes these
};

// Returns nullopt if there is no such pair.
std::optional<RelativePoseErrors> ComputeRpe(const std::vector<ViewPoseError>& views,
                                             const RpeOptions& options = {});

}  // namespace vgtw
