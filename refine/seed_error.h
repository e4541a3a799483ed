// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/triangulation.h"
#include "scene/reconstruction.h"

#include <map>
#include <vector>

namespace vgtw {

// Limits (pixels) below which right observations reproject under the poses and intrinsics of a
// seed, whose errors are measured by tracks: wide first, then at the scale of what was found.
struct SeedError {
  double median_px = 0.0;  // of observations from the points that fit their tracks best
  double max_px = 0.0;     // of the views together
  double worst_px = 0.0;   // bound of all; poses that are farther off are of no use to begin with
  std::map<ImageId, double> max_px_by_image;  // of each, at least max_px: views may be far off
};

// At most some thousand tracks are looked at, long ones first, because of two rays only the part
// across the epipolar line can be seen: where there are enough of three, the views together have
// the error of these alone.
SeedError MeasureSeedError(const Reconstruction& model,
                           const std::vector<Track>& tracks,
                           int num_threads);

}  // namespace vgtw
