// SPDX-License-Identifier: BSD-3-Clause
#include "matching/view_sketch.h"

#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// The cell, of cols x rows, that a point of the wall is seen in from (0, 0, 0).
std::pair<int, int> CellOf(const Eigen::Vector3d& point, int cols, int rows) {
  const double x = 61.2 * point.x() / point.z() + 32.0;
  const double y = 61.2 * point.y() / point.z() + 24.0;
  return {static_cast<int>(x / 64.0 * cols), static_cast<int>(y / 48.0 * rows)};
}

TEST(ViewSketch, PointsLieOnTheWallOneInEachCell) {
  const StaticView view(MakeWallView("a.png", 0.0), 0.5);
  const ViewSketch sketch = MakeViewSketch(view, 0.0, {.max_points = 192});
  EXPECT_EQ(sketch.view.name, "a.png");
  ASSERT_EQ(sketch.points.size(), 192u);  // 16 x 12
  std::set<std::pair<int, int>> cells;
  for (const Eigen::Vector3d& point : sketch.points) {
    EXPECT_NEAR(point.z(), kWallDepth, 1e-6);  // depth is a float
    cells.insert(CellOf(point, 16, 12));
  }
  EXPECT_EQ(cells.size(), 192u);
}

TEST(ViewSketch, NeverHoldsMorePointsThanAsked) {
  const StaticView view(MakeWallView("a.png", 0.0), 0.5);
  for (const int max_points : {1, 2, 5, 7, 100, 255, 256, 1000, 65536}) {
    const size_t num_points = MakeViewSketch(view, 0.0, {.max_points = max_points}).points.size();
    EXPECT_LE(num_points, static_cast<size_t>(max_points));
    // Whole rows of whole cells: not less than half of them, until all 32 x 24 pixels are taken.
    EXPECT_GE(2 * num_points, std::min(768u, static_cast<unsigned>(max_points)));
  }
}

TEST(ViewSketch, MapHoldsTheDepthInTheMiddleOfEachCell) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  for (int x = 0; x < 32; ++x) {
    for (int y = 0; y < 24; ++y) prediction.depth(x, y) = static_cast<float>(1 + x + 100 * y);
  }
  const StaticView view(prediction, 0.5);
  // Cells of 64 / 4 = 16 pixels, 8 of the network's: the middle lies between its pixels 3 and 4, of
  // which the first counts.
  const DepthMap map = MakeViewSketch(view, 0.0, {.map_size = 4}).depth;
  ASSERT_EQ(map.width(), 4);
  ASSERT_EQ(map.height(), 3);
  EXPECT_NEAR(map(0, 0), 304.0, 1e-4);
  EXPECT_NEAR(map(3, 2), 1 + 27 + 100 * 19, 1e-3);
}

TEST(ViewSketch, OnlyConfidentStaticDepthCounts) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth_conf = ConfidenceMap(32, 24, 5.0f);
  prediction.distractor = DistractorMask(32, 24, 0.0f);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 8; ++x) {
      prediction.distractor(x, y) = 1.0f;
      prediction.depth(x + 8, y) = kNaN;
      prediction.depth_conf(x + 16, y) = 2.0f;
    }
  }
  const ViewSketch sketch =
      MakeViewSketch(StaticView(prediction, 0.5), 3.0, {.max_points = 192, .map_size = 8});
  EXPECT_EQ(sketch.points.size(), 48u);  // the last of 4 quarters
  for (const Eigen::Vector3d& point : sketch.points) EXPECT_GE(CellOf(point, 16, 12).first, 12);
  ASSERT_EQ(sketch.depth.width(), 8);
  for (int y = 0; y < sketch.depth.height(); ++y) {
    for (int x = 0; x < sketch.depth.width(); ++x) {
      EXPECT_EQ(std::isnan(sketch.depth(x, y)), x < 6) << x << " " << y;
    }
  }
}

TEST(ViewSketch, FewSamplesMakeACoarseMap) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth = {};
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) {
      prediction.depth_samples.push_back(
          {{8.0f * static_cast<float>(x) + 4.0f, 8.0f * static_cast<float>(y) + 4.0f}, 3.0f, 1.0f});
    }
  }
  const ViewSketch sketch = MakeViewSketch(StaticView(prediction, 0.5), 0.0);
  EXPECT_EQ(sketch.points.size(), 48u);
  // 48 samples / 2 = 24 cells: 5 x 4 is what fits the shape, sqrt(24 * 4 / 3) = 5.66.
  EXPECT_EQ(sketch.depth.width(), 5);
  EXPECT_EQ(sketch.depth.height(), 4);
  for (const float depth : sketch.depth.data()) EXPECT_NEAR(depth, 3.0f, 1e-6);
}

TEST(ViewSketch, HasNoPointsWithoutDepth) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth = {};
  const ViewSketch no_depth = MakeViewSketch(StaticView(prediction, 0.5), 0.0);
  EXPECT_TRUE(no_depth.points.empty());
  EXPECT_TRUE(no_depth.depth.empty());
  EXPECT_EQ(no_depth.view.name, "a.png");
  prediction.depth = DepthMap(32, 24, kNaN);
  EXPECT_TRUE(MakeViewSketch(StaticView(prediction, 0.5), 0.0).points.empty());
}

TEST(ViewSketch, PointsOfAFaultyPoseAreLeftOut) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.view.cam_from_world.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(MakeViewSketch(StaticView(prediction, 0.5), 0.0).points.empty());
}

TEST(ViewSketchOptions, ErrorsNameFieldValueAndBounds) {
  EXPECT_NO_THROW(ViewSketchOptions{}.Check());
  try {
    ViewSketchOptions{.max_points = 0}.Check();
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("max_points = 0.000000, must be in [1, 65536"),
              std::string::npos)
        << error.what();
  }
  EXPECT_THROW(ViewSketchOptions{.map_size = 4097}.Check(), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
