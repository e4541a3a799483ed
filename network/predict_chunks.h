// SPDX-License-Identifier: BSD-3-Clause
// More views than a network takes in one pass: overlapping chunks, and how each is brought into the
// frame of those before it.
#pragma once

#include "network/predict.h"
#include "scene/prediction.h"
#include "scene/sim3d.h"

#include <optional>
#include <vector>

namespace vgtw {

// The views begin .. end - 1 of one pass, of which the first num_shared_views are also the last of
// the chunk before.
struct ViewChunk {
  int begin = 0;
  int end = 0;
  int num_shared_views = 0;
  bool operator==(const ViewChunk&) const = default;
};

// The fewest chunks of at most `max_views` that cover all views, equally large up to one view.
// Shares num_overlap_views, but at most half of max_views. Throws std::invalid_argument unless
// num_views >= 1, max_views >= 1 (2 where they do not fit in one) and num_overlap_views >= 1.
std::vector<ViewChunk> PlanChunks(int num_views, int max_views, int num_overlap_views);

struct AlignedChunk {
  Sim3d world_from_chunk;
  ChunkAlignment residuals;  // without first_view and num_views
};

// Aligns a chunk by the same views in its frame and in the world. The scale is the median ratio of
// depths at confident static pixels; rotation and translation come from the cameras' centres and
// axes, by a Sim3 that bears up to half of them being wrong, so that one shared view suffices.
// nullopt if no view is shared or no pixel has a depth in both.
std::optional<AlignedChunk> AlignChunk(const std::vector<ViewPrediction>& views_in_chunk,
                                       const std::vector<ViewPrediction>& views_in_world);

// Moves pose, depths and points of a prediction from a to b.
void TransformPrediction(const Sim3d& b_from_a, ViewPrediction& prediction);

}  // namespace vgtw
