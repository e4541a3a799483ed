// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "bridge/seed.h"
#include "scene/reconstruction.h"

#include <vector>

namespace vgtw {

// Links a view of the predictions with an image of the seed.
struct SeedView {
  size_t view_idx = 0;
  ImageId image_id = 0;
};

// Adds points and their observations to a seed that has cameras and images, and tells their figures
// in `summary`. Views are read three times, one per thread at a time (confidences; points; who sees
// them), so that memory holds the merged points and their observations, not the maps.
void AddSeedPoints(const PredictionReader& predictions,
                   const std::vector<SeedView>& views,
                   const SeedOptions& options,
                   Reconstruction& reconstruction,
                   SeedSummary& summary);

}  // namespace vgtw
