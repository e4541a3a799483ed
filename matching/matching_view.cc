// SPDX-License-Identifier: BSD-3-Clause
#include "matching/matching_view.h"

#include "matching/descriptor_distance.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace vgtw {
namespace {

constexpr size_t kNumBackgroundSamples = 256;
// Neighbours of a keypoint share its texture, but do not compete with it. Share of the longest
// side.
constexpr float kOwnTexture = 0.02f;

float LongestSide(const Camera& camera) {
  return static_cast<float>(std::max(camera.width, camera.height));
}

}  // namespace

MatchingView::MatchingView(ViewFeatures features)
    : features_(std::move(features)),
      grid_(features_.pixels,
            static_cast<float>(features_.view.camera.width),
            static_cast<float>(features_.view.camera.height)),
      background_distances_(BackgroundDistances(features_.descriptors,
                                                features_.pixels,
                                                kNumBackgroundSamples,
                                                kOwnTexture * LongestSide(features_.view.camera))),
      idxs_by_scale_(features_.size()) {
  std::iota(idxs_by_scale_.begin(), idxs_by_scale_.end(), 0u);
  std::stable_sort(idxs_by_scale_.begin(), idxs_by_scale_.end(), [this](uint32_t a, uint32_t b) {
    return features_.scales[a] > features_.scales[b];
  });
}

}  // namespace vgtw
