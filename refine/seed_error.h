// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/triangulation.h"
#include "scene/reconstruction.h"

#include <vector>

namespace vgtw {

struct SeedError {
  double median_px = 0.0;  // of observations from the points that fit their tracks best
  // Limit below which right observations reproject under these poses.
  double max_px = 0.0;
};

// The error that poses and intrinsics make, measured by tracks: wide first, then at the scale of
// what was found. At most some thousand tracks are looked at, long ones first, because of two rays
// only the part across the epipolar line can be seen.
SeedError MeasureSeedError(const Reconstruction& model,
                           const std::vector<Track>& tracks,
                           int num_threads);

}  // namespace vgtw
