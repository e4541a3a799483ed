// SPDX-License-Identifier: BSD-3-Clause
#include "matching/covisibility.h"

#include "tests/support/wall_prediction.h"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr double kDegPerRad = 180.0 / std::numbers::pi;

// Every one of the 32 x 24 network pixels is a point, of 2 x 2 original pixels each.
ViewSketch Sketch(const ViewPrediction& prediction, double confidence_threshold = 0.0) {
  return MakeViewSketch(
      StaticView(prediction, 0.5), confidence_threshold, {.max_points = 768, .map_size = 32});
}

// Exact predictions need no allowance.
CovisibilityOptions Exact() {
  return {.max_relative_depth_difference = 0.01, .position_error_percent = 0.0};
}

TEST(Covisibility, IsTheShareOfTheWallThatBothSee) {
  const std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)),
                                            Sketch(MakeWallView("b.png", 0.5)),
                                            Sketch(MakeWallView("c.png", 4.0)),
                                            Sketch(MakeWallView("d.png", 5.5))};
  const Covisibility covisibility(sketches, Exact());
  // Points at x = 1, 3, 5, ... 63 px move by 6 px to the left: 29 of 32 columns stay.
  const auto near = covisibility.Measure(1, 0);
  ASSERT_TRUE(near);
  EXPECT_EQ(near->view_idx1, 0u);
  EXPECT_EQ(near->view_idx2, 1u);
  EXPECT_DOUBLE_EQ(near->covisibility, 29.0 / 32.0);
  // By 48 px: 8 columns stay. By 66 px: none.
  EXPECT_DOUBLE_EQ(covisibility.Measure(0, 2)->covisibility, 8.0 / 32.0);
  EXPECT_FALSE(covisibility.Measure(0, 3));
}

TEST(Covisibility, AngleIsTheMedianOfThoseOfThePoints) {
  std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)),
                                      Sketch(MakeWallView("b.png", 1.0))};
  for (ViewSketch& sketch : sketches) {
    sketch.points = {{0.5, 0.0, 5.1}, {0.0, 0.0, 5.1}, {1.0, 0.0, 5.1}};
  }
  // atan(1 / 5.1) for four of the six, and twice 2 * atan(0.5 / 5.1), which is larger.
  EXPECT_NEAR(Covisibility(sketches, Exact()).Measure(0, 1)->angle_deg,
              std::atan(1.0 / 5.1) * kDegPerRad,
              1e-9);
}

TEST(Covisibility, TheViewThatSharesLessCounts) {
  // Half as far from the wall, the second view sees a quarter of what the first one sees: columns
  // and rows 8 to 24 and 6 to 18.
  std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0))};
  ViewPrediction near = MakeWallView("b.png", 0.0);
  near.view.cam_from_world.translation.z() = -0.5 * kWallDepth;
  near.depth = DepthMap(32, 24, static_cast<float>(0.5 * kWallDepth));
  sketches.push_back(Sketch(near));
  EXPECT_DOUBLE_EQ(Covisibility(sketches, Exact()).Measure(0, 1)->covisibility, 0.25);
  // At twice the size nothing matches if 1.9 is the limit.
  CovisibilityOptions options = Exact();
  options.max_size_ratio = 1.9;
  EXPECT_FALSE(Covisibility(sketches, options).Measure(0, 1));
}

TEST(Covisibility, WhatIsOccludedIsNotShared) {
  // Something at half the depth hides the left half of the wall from the second view.
  ViewPrediction hidden = MakeWallView("b.png", 0.0);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 16; ++x) hidden.depth(x, y) *= 0.5f;
  }
  const std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)), Sketch(hidden)};
  EXPECT_DOUBLE_EQ(Covisibility(sketches, Exact()).Measure(0, 1)->covisibility, 0.5);
}

// A view at z that looks along -z, at a wall at `depth`.
ViewPrediction MakeViewFromBehind(double z, double depth) {
  ViewPrediction behind = MakeWallView("b.png", 0.0);
  behind.view.cam_from_world =
      LookAt({0.0, 0.0, z}, Eigen::Vector3d::Zero(), Eigen::Vector3d(0.0, -1.0, 0.0));
  behind.depth = DepthMap(32, 24, static_cast<float>(depth));
  return behind;
}

TEST(Covisibility, TwoSidesOfAWallAreNotShared) {
  // Each sees its side of a thick wall, which is farther from the other one.
  const std::vector<ViewSketch> thick = {Sketch(MakeWallView("a.png", 0.0)),
                                         Sketch(MakeViewFromBehind(13.2, 5.1))};
  EXPECT_FALSE(Covisibility(thick, {.max_ray_angle_deg = 180.0}).Measure(0, 1));
  // A thin wall is at the right depth for both, but the rays come from opposite sides.
  const std::vector<ViewSketch> thin = {Sketch(MakeWallView("a.png", 0.0)),
                                        Sketch(MakeViewFromBehind(10.2, 5.1))};
  EXPECT_FALSE(Covisibility(thin, {}).Measure(0, 1));
  EXPECT_TRUE(Covisibility(thin, {.max_ray_angle_deg = 180.0}).Measure(0, 1));
}

TEST(Covisibility, DistractorsAndWeakDepthDoNotCount) {
  ViewPrediction masked = MakeWallView("b.png", 0.0);
  masked.distractor = DistractorMask(32, 24, 0.0f);
  masked.depth_conf = ConfidenceMap(32, 24, 9.0f);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 4; ++x) {
      masked.distractor(x, y) = 1.0f;
      masked.depth_conf(x + 4, y) = 1.0f;
    }
  }
  const std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)),
                                            Sketch(masked, 2.0)};
  EXPECT_DOUBLE_EQ(Covisibility(sketches, Exact()).Measure(0, 1)->covisibility, 0.75);
}

TEST(Covisibility, ToleratesWhatItIsToldTo) {
  ViewPrediction wrong = MakeWallView("b.png", 0.0);
  for (float& depth : wrong.depth.data()) depth *= 1.2f;
  const std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)), Sketch(wrong)};
  EXPECT_FALSE(Covisibility(sketches, {.max_relative_depth_difference = 0.19}).Measure(0, 1));
  EXPECT_DOUBLE_EQ(
      Covisibility(sketches, {.max_relative_depth_difference = 0.21}).Measure(0, 1)->covisibility,
      1.0);
}

TEST(Covisibility, DepthCountsWithinThePositionError) {
  ViewPrediction half = MakeWallView("b.png", 0.0);
  for (int y = 0; y < 24; ++y) {
    for (int x = 16; x < 32; ++x) half.depth(x, y) *= 2.0f;
  }
  std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)), Sketch(half)};
  sketches[1].points.clear();  // so that the first view's count alone
  EXPECT_DOUBLE_EQ(Covisibility(sketches, Exact()).Measure(0, 1)->covisibility, 0.5);
  CovisibilityOptions options = Exact();
  options.position_error_percent = 5.0;
  // 3.2 px: points at 33 and 35 px reach what is left of 32 px, two columns more of 32.
  EXPECT_DOUBLE_EQ(Covisibility(sketches, options).Measure(0, 1)->covisibility, 18.0 / 32.0);
}

TEST(Covisibility, ADistortedLensDoesNotFoldTheWorldIntoTheImage) {
  ViewPrediction wide = MakeWallView("b.png", 0.0);
  wide.view.camera.model = CameraModel::kSimpleRadial;
  wide.view.camera.params = {61.2, 32.0, 24.0, -0.3};
  // At r = 1.8, far outside of the corners at r = 0.9, r (1 - 0.3 r^2) = 0.05 or 3 px.
  const Eigen::Vector3d outside(1.8 * 5.1, 0.0, 5.1);
  ASSERT_NEAR(Project(wide.view.camera, outside)->x(), 35.0, 0.2);
  ViewSketch eye;
  eye.view = wide.view;
  ViewSketch point;
  point.view = MakeWallView("a.png", 1.8 * 5.1).view;
  point.points = {outside};
  const std::vector<ViewSketch> sketches = {point, eye};
  EXPECT_FALSE(Covisibility(sketches, {.max_ray_angle_deg = 180.0}).Measure(0, 1));
}

TEST(Covisibility, OfPosesAloneIsOverlapAtTheAssumedDepth) {
  std::vector<ViewSketch> sketches(3);
  for (size_t i = 0; i < 3; ++i) {
    sketches[i].view = MakeWallView("a.png", std::array{0.0, 0.6, 1.0}[i]).view;
  }
  // The middle view's farthest is 0.6 away, the others' 1: the median is 4 * 1 * 61.2 / 64.
  const Covisibility covisibility(sketches, {});
  const double depth = 4.0 * 61.2 / 64.0;
  EXPECT_NEAR(covisibility.PointsOf(0)[1].z(), depth, 1e-9);
  // A step of 1 is 16 px at that depth, 32 at half of it, 8 at twice; one of 0.6 is 9.6, 19.2 and
  // 4.8 px. Of columns at 4, 12, ..., 60 px those stay that are not to the left of that.
  EXPECT_DOUBLE_EQ(covisibility.Measure(1, 0)->covisibility, (7.0 + 6.0 + 7.0) / 24.0);
  EXPECT_DOUBLE_EQ(covisibility.Measure(0, 2)->covisibility, (6.0 + 4.0 + 7.0) / 24.0);
}

TEST(Covisibility, ViewsWithoutDepthAreJudgedByThoseWithDepth) {
  ViewSketch blind;
  blind.view = MakeWallView("b.png", 0.5).view;
  const std::vector<ViewSketch> sketches = {Sketch(MakeWallView("a.png", 0.0)), blind, blind};
  const Covisibility covisibility(sketches, Exact());
  EXPECT_DOUBLE_EQ(covisibility.Measure(0, 1)->covisibility, 29.0 / 32.0);
  // The assumed depth is that of the view that knows its own.
  EXPECT_NEAR(covisibility.PointsOf(1)[1].z(), kWallDepth, 1e-6);
  EXPECT_DOUBLE_EQ(covisibility.Measure(1, 2)->covisibility, 1.0);
}

TEST(Covisibility, FaultyViewsShareNothing) {
  std::vector<ViewSketch> sketches(3, Sketch(MakeWallView("a.png", 0.0)));
  sketches[1].view.cam_from_world.translation.x() = std::numeric_limits<double>::quiet_NaN();
  sketches[2].view.camera.params[0] = 0.0;
  sketches[0].points[0].x() = std::numeric_limits<double>::quiet_NaN();
  const Covisibility covisibility(sketches, {});
  EXPECT_FALSE(covisibility.Measure(0, 1));
  EXPECT_FALSE(covisibility.Measure(0, 2));
  EXPECT_FALSE(covisibility.Measure(1, 2));
  EXPECT_THROW(covisibility.Measure(0, 0), std::invalid_argument);
  EXPECT_THROW(covisibility.Measure(0, 3), std::invalid_argument);
}

TEST(CovisibilityOptions, ErrorsNameFieldValueAndBounds) {
  EXPECT_NO_THROW(CovisibilityOptions{}.Check());
  EXPECT_THROW(CovisibilityOptions{.max_relative_depth_difference = 0.0}.Check(),
               std::invalid_argument);
  EXPECT_THROW(CovisibilityOptions{.position_error_percent = -1.0}.Check(), std::invalid_argument);
  EXPECT_THROW(CovisibilityOptions{.max_ray_angle_deg = 181.0}.Check(), std::invalid_argument);
  try {
    CovisibilityOptions{.max_size_ratio = 0.5}.Check();
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what())
                  .find("CovisibilityOptions::max_size_ratio = 0.500000, must be in [1, 1000]"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace vgtw
