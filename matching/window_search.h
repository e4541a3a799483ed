// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/matching_view.h"
#include "matching/search_window.h"
#include "scene/features.h"

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

namespace vgtw {

struct WindowSearchOptions {
  // A match must be nearer than this times the second best in its window; in (0, 1].
  double max_ratio = 0.8;
  // And nearer than this times what looks like either feature elsewhere in its own photo: the
  // second best of a small window says little, and a repeated pattern may have one copy in it.
  // In (0, 1].
  double max_background_ratio = 0.9;
  // Scales agree with the predicted ratio up to this factor; >= 1.
  double max_scale_factor = 2.0;

  void Check() const;
};

using WindowOfFeature = std::function<std::optional<SearchWindow>(uint32_t idx1)>;
using MayMatch = std::function<bool(uint32_t idx1, uint32_t idx2)>;

// Matches of the features `idxs1` of view 1, each with the nearest descriptor among the features of
// view 2 in its window that `may_match` (empty = all). Mutual: idx1 is also the nearest among all
// whose windows hold idx2. Sorted by idx1.
FeatureMatches SearchWindows(const MatchingView& view1,
                             const MatchingView& view2,
                             std::span<const uint32_t> idxs1,
                             const WindowOfFeature& window_of,
                             const MayMatch& may_match,
                             const WindowSearchOptions& options);

// Plain matching, without windows: all of idxs1 with all of idxs2, ratio test and mutual.
FeatureMatches SearchAll(const MatchingView& view1,
                         const MatchingView& view2,
                         std::span<const uint32_t> idxs1,
                         std::span<const uint32_t> idxs2,
                         const WindowSearchOptions& options);

}  // namespace vgtw
