// SPDX-License-Identifier: BSD-3-Clause
#include "matching/window_search.h"

#include "matching/descriptor_distance.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace vgtw {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// The nearest and second nearest of a feature; squared distances.
struct Nearest {
  uint32_t idx = kNone;
  float distance = kInfinity;
  float second_distance = kInfinity;

  void Offer(uint32_t other_idx, float other_distance) {
    if (other_distance < distance) {
      second_distance = distance;
      distance = other_distance;
      idx = other_idx;
    } else if (other_distance < second_distance) {
      second_distance = other_distance;
    }
  }
};

bool IsScaleNear(float scale1, float scale2, float scale_ratio, float max_factor) {
  const float expected = scale1 * scale_ratio;
  if (!(expected > 0.0f) || !(scale2 > 0.0f)) return true;  // nothing is known
  return scale2 <= expected * max_factor && expected <= scale2 * max_factor;
}

FeatureMatches MutualMatches(const MatchingView& view1,
                             const MatchingView& view2,
                             std::span<const uint32_t> idxs1,
                             const std::vector<Nearest>& nearest1,
                             const std::vector<Nearest>& nearest2,
                             const WindowSearchOptions& options) {
  // Distances are squared, hence so are ratios.
  const auto max_ratio2 = static_cast<float>(options.max_ratio * options.max_ratio);
  const auto max_background_ratio2 =
      static_cast<float>(options.max_background_ratio * options.max_background_ratio);
  FeatureMatches matches;
  for (size_t k = 0; k < idxs1.size(); ++k) {
    const Nearest& found = nearest1[k];
    if (found.idx == kNone || nearest2[found.idx].idx != idxs1[k]) continue;
    // Not nearer also where both are 0: exact copies.
    if (found.distance >= max_ratio2 * found.second_distance ||
        found.distance >= max_ratio2 * nearest2[found.idx].second_distance) {
      continue;
    }
    const float background =
        std::min(view1.BackgroundDistance(idxs1[k]), view2.BackgroundDistance(found.idx));
    if (found.distance >= max_background_ratio2 * background) continue;
    matches.push_back({idxs1[k], found.idx});
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

}  // namespace

void WindowSearchOptions::Check() const {
  VGTW_CHECK(max_ratio > 0.0 && max_ratio <= 1.0, "WindowSearchOptions::max_ratio");
  VGTW_CHECK(max_background_ratio > 0.0 && max_background_ratio <= 1.0,
             "WindowSearchOptions::max_background_ratio");
  VGTW_CHECK(max_scale_factor >= 1.0, "WindowSearchOptions::max_scale_factor");
}

FeatureMatches SearchWindows(const MatchingView& view1,
                             const MatchingView& view2,
                             std::span<const uint32_t> idxs1,
                             const WindowOfFeature& window_of,
                             const MayMatch& may_match,
                             const WindowSearchOptions& options) {
  options.Check();
  const ViewFeatures& features1 = view1.features();
  const ViewFeatures& features2 = view2.features();
  const DescriptorDistance distance(features1.descriptors, features2.descriptors);
  const auto max_scale_factor = static_cast<float>(options.max_scale_factor);
  std::vector<Nearest> nearest1(idxs1.size());
  std::vector<Nearest> nearest2(features2.size());
  for (size_t k = 0; k < idxs1.size(); ++k) {
    const uint32_t idx1 = idxs1[k];
    const auto window = window_of(idx1);
    if (!window) continue;
    view2.grid().ForEachIn(window->capsule, [&](uint32_t idx2) {
      if (!IsScaleNear(features1.scales[idx1],
                       features2.scales[idx2],
                       window->scale_ratio,
                       max_scale_factor) ||
          (may_match && !may_match(idx1, idx2))) {
        return;
      }
      const float squared_distance = distance(idx1, idx2);
      nearest1[k].Offer(idx2, squared_distance);
      nearest2[idx2].Offer(idx1, squared_distance);
    });
  }
  return MutualMatches(view1, view2, idxs1, nearest1, nearest2, options);
}

FeatureMatches SearchAll(const MatchingView& view1,
                         const MatchingView& view2,
                         std::span<const uint32_t> idxs1,
                         std::span<const uint32_t> idxs2,
                         const WindowSearchOptions& options) {
  options.Check();
  const DescriptorDistance distance(view1.features().descriptors, view2.features().descriptors);
  std::vector<Nearest> nearest1(idxs1.size());
  std::vector<Nearest> nearest2(view2.features().size());
  for (size_t k = 0; k < idxs1.size(); ++k) {
    for (const uint32_t idx2 : idxs2) {
      const float squared_distance = distance(idxs1[k], idx2);
      nearest1[k].Offer(idx2, squared_distance);
      nearest2[idx2].Offer(idxs1[k], squared_distance);
    }
  }
  return MutualMatches(view1, view2, idxs1, nearest1, nearest2, options);
}

}  // namespace vgtw
