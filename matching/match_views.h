// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/covisibility.h"
#include "matching/match_pair.h"
#include "matching/view_features.h"
#include "scene/progress.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

namespace vgtw {

struct MatchViewsOptions {
  MatchPairOptions pair;
  // Features kept in memory, bytes; those of the pairs being matched count even if they exceed it.
  int64_t max_memory = int64_t{2} << 30;
  int num_threads = 0;  // 0 = all cores
};

// Gives the features of a view; called by one thread at a time, and again for a view whose features
// had to leave memory.
using LoadViewFeatures = std::function<ViewFeatures(size_t view_idx)>;
// Takes the result of pairs[pair_idx]; called by one thread at a time, in the order of the pairs.
using TakeMatchedPair = std::function<void(size_t pair_idx, MatchedPair pair)>;

// MatchPair for many pairs. The most covisible pair of each view comes first and shows by how much
// windows have to be widened around it: the other pairs of the view start with these. So the result
// depends neither on threads nor on memory.
void MatchViews(const std::vector<ViewPair>& pairs,
                size_t num_views,
                const LoadViewFeatures& load,
                const TakeMatchedPair& take,
                const MatchViewsOptions& options,
                const ProgressCallback& progress = {});

}  // namespace vgtw
