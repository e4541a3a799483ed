// SPDX-License-Identifier: BSD-3-Clause
#include "scene/prediction.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

ViewPrediction MakeGood() {
  ViewPrediction prediction;
  prediction.view.name = "a/b.jpg";
  prediction.view.camera = MakePinhole(40, 30, 30, 30);
  prediction.view.network_width = 4;
  prediction.view.network_height = 3;
  prediction.view.original_from_network << 10, 0, 0, 0, 10, 0;
  prediction.depth = DepthMap(4, 3, 2.0f);
  prediction.depth(1, 1) = kNaN;
  prediction.depth_conf = ConfidenceMap(4, 3, 5.0f);
  prediction.distractor = DistractorMask(4, 3, 1.0f);
  prediction.distractor(0, 0) = kNaN;
  prediction.points = Grid<Eigen::Vector3f>(4, 3);
  prediction.depth_samples = {{{1.0f, 2.0f}, 3.0f, 1.0f}};
  return prediction;
}

// The fault after `change` of a good prediction.
std::string FaultAfter(const std::function<void(ViewPrediction&)>& change) {
  ViewPrediction prediction = MakeGood();
  change(prediction);
  return FindFault(prediction);
}

TEST(ViewPrediction, WithoutFaultHasNone) {
  EXPECT_EQ(FindFault(MakeGood()), "");
  ViewPrediction empty;
  empty.view = MakeGood().view;
  EXPECT_EQ(FindFault(empty), "");
}

TEST(ViewPrediction, FaultsOfTheViewAreNamed) {
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.name = "../a.jpg"; }),
            "the name is not a safe relative path");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.camera.params[0] = -1.0; }),
            "focal length is not positive");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.cam_from_world.translation.x() = kNaN; }),
            "the translation is not finite");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.cam_from_world.rotation.w() = 0.5; }),
            "the rotation is not a unit quaternion");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.original_from_network(1, 1) = 0.0; }),
            "original_from_network has no inverse");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.original_from_network(1, 2) = kInfinity; }),
            "original_from_network has no inverse");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.network_width = -4; }), "the network size is negative");
}

TEST(ViewPrediction, MapsOfTheWrongSizeAreNamed) {
  EXPECT_EQ(FaultAfter([](auto& p) { p.depth = DepthMap(3, 4, 1.0f); }),
            "depth is not of the network size");
  EXPECT_EQ(FaultAfter([](auto& p) { p.depth_conf = ConfidenceMap(4, 4, 1.0f); }),
            "depth_conf is not of the network size");
  EXPECT_EQ(FaultAfter([](auto& p) { p.distractor = DistractorMask(5, 3, 0.0f); }),
            "distractor is not of the network size");
  EXPECT_EQ(FaultAfter([](auto& p) { p.points = Grid<Eigen::Vector3f>(3, 3); }),
            "points is not of the network size");
  EXPECT_EQ(FaultAfter([](auto& p) { p.view.network_width = p.view.network_height = 0; }),
            "depth is not of the network size");
}

TEST(ViewPrediction, ImpossibleValuesAreNamed) {
  for (const float depth : {0.0f, -1.0f, kInfinity}) {
    EXPECT_EQ(FaultAfter([&](auto& p) { p.depth(3, 2) = depth; }),
              "a depth is neither positive nor unknown");
  }
  for (const float probability : {-0.01f, 1.01f, kInfinity}) {
    EXPECT_EQ(FaultAfter([&](auto& p) { p.distractor(3, 2) = probability; }),
              "a distractor probability is outside [0, 1]");
  }
  for (const float depth : {0.0f, -1.0f, kInfinity, kNaN}) {
    EXPECT_EQ(FaultAfter([&](auto& p) { p.depth_samples[0].depth = depth; }),
              "a depth sample is not finite and positive");
  }
  EXPECT_EQ(FaultAfter([](auto& p) { p.depth_samples[0].pixel_in_original.x() = kNaN; }),
            "a depth sample is not finite and positive");
}

}  // namespace
}  // namespace vgtw
