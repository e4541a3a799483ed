// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/feature_grid.h"
#include "matching/view_features.h"

#include <cstdint>
#include <vector>

namespace vgtw {

// A view made ready for being matched with several others.
class MatchingView {
 public:
  // Throws std::invalid_argument if there is not a descriptor per keypoint or the camera has no
  // size.
  explicit MatchingView(ViewFeatures features);
  MatchingView(const MatchingView&) = delete;
  MatchingView& operator=(const MatchingView&) = delete;

  const ViewFeatures& features() const { return features_; }
  const FeatureGrid& grid() const { return grid_; }
  // Squared distance of the descriptor to what looks like it elsewhere in the same photo.
  float BackgroundDistance(size_t idx) const { return background_distances_[idx]; }
  // Keypoints by falling scale: the large ones are fewer, and are found again from elsewhere.
  const std::vector<uint32_t>& idxs_by_scale() const { return idxs_by_scale_; }

 private:
  ViewFeatures features_;
  FeatureGrid grid_;
  std::vector<float> background_distances_;
  std::vector<uint32_t> idxs_by_scale_;
};

}  // namespace vgtw
