// SPDX-License-Identifier: BSD-3-Clause
#include "matching/view_features.h"

#include "tests/support/wall_prediction.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Two keypoints on the wall: the axis is at pixel (32, 24), the focal length 61.2.
Features TwoFeatures() {
  Features features;
  features.keypoints = {2, 4, {32, 24, 1.5, 0, 44, 30, 3, 0}};
  features.descriptors = {2, 128, 0, std::vector<uint8_t>(256)};
  return features;
}

TEST(ViewFeatures, KeypointsLieOnTheWall) {
  const ViewPrediction prediction = MakeWallView("a.png", 0.5);
  const StaticView static_view(prediction, 0.5);
  const ViewFeatures features = MakeViewFeatures(prediction.view, TwoFeatures(), &static_view);
  ASSERT_EQ(features.size(), 2u);
  EXPECT_EQ(features.scales, (std::vector<float>{1.5f, 3.0f}));
  EXPECT_EQ(features.descriptors.data.size(), 256u);
  // 12 px / 61.2 * 5.1 = 1, 6 px / 61.2 * 5.1 = 0.5; rays are floats: 1e-7 of them times 5.1.
  EXPECT_LT((features.PointInWorld(0) - Eigen::Vector3d(0.5, 0.0, 5.1)).norm(), 1e-6);
  EXPECT_LT((features.PointInWorld(1) - Eigen::Vector3d(1.5, 0.5, 5.1)).norm(), 1e-6);
}

TEST(ViewFeatures, WithoutConfidentDepthTheyHaveNoPlace) {
  ViewPrediction prediction = MakeWallView("a.png", 0.5);
  prediction.depth_conf = ConfidenceMap(32, 24, 2.0f);
  prediction.depth_conf(16, 12) = 5.0f;  // of pixel (32, 24)
  const StaticView static_view(prediction, 0.5);
  const ViewFeatures features = MakeViewFeatures(prediction.view, TwoFeatures(), &static_view, 3.0);
  EXPECT_EQ(features.depth_confs, (std::vector<float>{5.0f, 0.0f}));
  EXPECT_TRUE(std::isnan(features.depths[1]));
  EXPECT_TRUE(features.PointInWorld(1).hasNaN());
  EXPECT_TRUE(std::isnan(MakeViewFeatures(prediction.view, TwoFeatures(), nullptr).depths[0]));
}

TEST(ViewFeatures, RefusesOtherNumbersOfDescriptors) {
  Features features = TwoFeatures();
  features.descriptors.rows = 1;
  EXPECT_THROW(MakeViewFeatures({}, features, nullptr), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
