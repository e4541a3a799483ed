// SPDX-License-Identifier: BSD-3-Clause
#include "matching/matching_view.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Features of 1000 x 500 pixels in a row, `step` apart, with descriptors of one byte.
ViewFeatures Row(const std::vector<uint8_t>& descriptors, float step) {
  ViewFeatures features;
  features.view.camera = MakePinhole(1000, 500, 900.0, 900.0);
  features.descriptors = {static_cast<uint32_t>(descriptors.size()), 1, 0, descriptors};
  for (size_t i = 0; i < descriptors.size(); ++i) {
    features.pixels.emplace_back(step * static_cast<float>(i), 10.0f);
    features.rays.emplace_back(0.0f, 0.0f);
    features.scales.push_back(1.0f);
    features.depths.push_back(1.0f);
    features.depth_confs.push_back(1.0f);
  }
  return features;
}

TEST(MatchingView, SortsByFallingScale) {
  ViewFeatures features = Row({1, 2, 3, 4, 5}, 100.0f);
  features.scales = {2.0f, 7.0f, 0.0f, 2.0f, 9.0f};
  // Equal ones as they came.
  EXPECT_EQ(MatchingView(features).idxs_by_scale(), (std::vector<uint32_t>{4, 1, 0, 3, 2}));
}

// 2 % of the longest side are 20 pixels: neighbours at 19 do not count, those at 20 do.
TEST(MatchingView, BackgroundLeavesOutTheOwnTexture) {
  const MatchingView near(Row({0, 1, 3}, 19.0f));
  EXPECT_EQ(near.BackgroundDistance(0), 9.0f);
  EXPECT_TRUE(std::isinf(near.BackgroundDistance(1)));
  EXPECT_EQ(near.BackgroundDistance(2), 9.0f);
  const MatchingView far(Row({0, 1, 3}, 20.0f));
  EXPECT_EQ(far.BackgroundDistance(0), 1.0f);
  EXPECT_EQ(far.BackgroundDistance(1), 1.0f);
  EXPECT_EQ(far.BackgroundDistance(2), 4.0f);
}

TEST(MatchingView, GridHoldsItsOwnPixels) {
  const MatchingView view(Row({0, 1, 3}, 19.0f));
  std::vector<uint32_t> found;
  view.grid().ForEachIn({{15, 10}, {40, 10}, 1.0f}, [&](uint32_t idx) { found.push_back(idx); });
  EXPECT_EQ(found, (std::vector<uint32_t>{1, 2}));
}

TEST(MatchingView, MayBeEmptyButNotWithoutDescriptors) {
  const MatchingView empty(Row({}, 1.0f));
  EXPECT_TRUE(empty.idxs_by_scale().empty());
  ViewFeatures features = Row({1, 2}, 100.0f);
  features.descriptors = {};
  EXPECT_THROW(MatchingView{features}, std::invalid_argument);
  ViewFeatures no_size = Row({1, 2}, 100.0f);
  no_size.view.camera.width = 0;
  EXPECT_THROW(MatchingView{no_size}, std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
