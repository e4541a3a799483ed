// SPDX-License-Identifier: BSD-3-Clause
// What ApplyMasks does to the tables, by rule.
#pragma once

#include "bridge/mask_apply_images.h"

#include <cstdint>
#include <vector>

namespace vgtw {

class MaskUndo;
class SqliteConnection;

// Excludes also every keypoint that inlier matches link to an excluded one, directly or over
// others; returns how many. Advances by one per two-view geometry.
uint64_t ExcludeTracks(SqliteConnection& connection,
                       std::vector<MaskedImage>& images,
                       ProgressCounter& progress);

// Removes excluded keypoints and their descriptors by `undo`, on the same connection. Advances by
// one per image.
void RemoveKeypoints(SqliteConnection& connection,
                     const std::vector<MaskedImage>& images,
                     MaskUndo& undo,
                     ProgressCounter& progress);

struct FilterPairsOptions {
  bool renumber = false;  // for tables whose excluded keypoints were removed
  uint64_t min_num_inliers = 0;
};

// Removes the rows of matches and two-view geometries with an excluded endpoint, in the same way.
// Advances by one per row of the tables. Tells of each image whether it had and has a geometry.
void FilterPairs(SqliteConnection& connection,
                 const FilterPairsOptions& options,
                 MaskUndo& undo,
                 ProgressCounter& progress,
                 std::vector<MaskedImage>& images,
                 ApplyMasksSummary& summary);

}  // namespace vgtw
