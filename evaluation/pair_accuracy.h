// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <cstddef>
#include <vector>

namespace vgtw {

// Errors of cam2_from_cam1, which no alignment can change.
struct PairError {
  size_t view1 = 0;  // view1 < view2
  size_t view2 = 0;
  double rotation_deg = 0.0;  // in [0, 180]
  // Of the direction from camera 1 to camera 2 in camera 1's frame, in [0, 180]; NaN for cameras
  // closer than 1e-9 of the largest distance between any, in either set: they have no direction.
  double direction_deg = 0.0;
};

// Over all pairs, by view1, then view2. Views in the same order in both sets.
std::vector<PairError> ComputePairErrors(const std::vector<Rigid3d>& estimate,
                                         const std::vector<Rigid3d>& reference);

// Shares of pairs in [0, 1] that are right within a threshold. A pair without a direction counts
// by its rotation in the AUC and not at all in RTA.
struct PairAccuracy {
  double threshold_deg = 0.0;
  double rotation = 0.0;   // RRA: rotation errors below the threshold
  double direction = 0.0;  // RTA: min(a, 180 - a) of direction errors a below the threshold
  // AUC: area under the share of pairs whose larger error of both is below a threshold, over
  // thresholds up to this one, in two definitions that differ (all errors of 0.5 deg have 1 and
  // 0.83 at 3 deg).
  // "histogram": mean of the cumulative histogram of bins of 1 deg, of min(a, 180 - a); as VGGT's,
  // PoseDiffusion's and pi3's evaluations of CO3D and RealEstate10K.
  double auc_histogram = 0.0;
  // "trapezoid": integral of the recall curve through (0, 0) and (i-th smallest error, i / n), of
  // a; as COLMAP's benchmark.
  double auc_trapezoid = 0.0;
};

// `num_missing` further pairs, of views that the estimate lacks, count as wrong. `threshold_deg` is
// an integer >= 1. NaN without any pair.
PairAccuracy ComputePairAccuracy(const std::vector<PairError>& errors,
                                 int threshold_deg,
                                 size_t num_missing = 0);

// The two definitions on errors as they are, of which infinity is a wrong pair; NaN for none.
double AucHistogram(const std::vector<double>& errors_deg, int threshold_deg);
double AucTrapezoid(std::vector<double> errors_deg, double threshold_deg);

}  // namespace vgtw
