// SPDX-License-Identifier: BSD-3-Clause
#include "scene/static_view.h"

#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kThreshold = 0.5;

TEST(StaticView, PointsLieAtTheDepthOfTheirPixels) {
  const std::vector<StaticView::Point> points =
      StaticView(MakeWallView("a.png", -0.5), kThreshold).StaticPoints(0.0);
  ASSERT_EQ(points.size(), 32u * 24u);
  // The first network pixel's centre (0.5, 0.5) is (1, 1) in the photo; the axis is at (32, 24).
  EXPECT_EQ(points[0].pixel_in_original, Eigen::Vector2d(1.0, 1.0));
  // Depth is stored as a float: 5.1 to 1e-7.
  const Eigen::Vector3d expected(-0.5 + (1.0 - 32.0) / 12.0, (1.0 - 24.0) / 12.0, 5.1);
  EXPECT_LT((points[0].xyz - expected).norm(), 1e-6);
}

TEST(StaticView, DistractorsUnknownDepthAndLowConfidenceGiveNoPoint) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.distractor = DistractorMask(32, 24, 0.1f);
  prediction.distractor(0, 0) = 0.5f;  // reaches the threshold
  prediction.distractor(1, 0) = kNaN;  // unknown is not static
  prediction.depth(2, 0) = kNaN;
  prediction.depth_conf = ConfidenceMap(32, 24, 3.0f);
  prediction.depth_conf(3, 0) = 2.9f;
  prediction.depth_conf(4, 0) = kNaN;
  const std::vector<StaticView::Point> points =
      StaticView(prediction, kThreshold).StaticPoints(3.0);
  ASSERT_EQ(points.size(), 32u * 24u - 5u);
  EXPECT_EQ(points[0].pixel_in_original, Eigen::Vector2d(11.0, 1.0));
}

TEST(StaticView, ConfidencesAreThoseOfKnownDepth) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth_conf = ConfidenceMap(32, 24, 3.0f);
  prediction.depth(2, 0) = kNaN;
  prediction.distractor = DistractorMask(32, 24, 1.0f);  // the share is taken before the mask
  ConfidenceHistogram histogram;
  StaticView(prediction, kThreshold).AddConfidencesTo(histogram);
  EXPECT_EQ(histogram.count(), 32u * 24u - 1u);
}

TEST(StaticView, SeesWhatAgreesWithItsDepth) {
  const StaticView view(MakeWallView("a.png", 0.0), kThreshold);
  const auto pixel = view.See({1.0, 0.5, 5.1}, 0.02);
  ASSERT_TRUE(pixel);
  EXPECT_LT((*pixel - Eigen::Vector2d(44.0, 30.0)).norm(), 1e-12);
  EXPECT_TRUE(view.See({1.0, 0.5, 5.1 * 1.019}, 0.02));
  EXPECT_FALSE(view.See({1.0, 0.5, 5.1 * 1.021}, 0.02));  // behind the wall
  EXPECT_FALSE(view.See({1.0, 0.5, 5.1 * 0.979}, 0.02));  // in front of it
  EXPECT_FALSE(view.See({1.0, 0.5, -5.1}, 0.02));         // behind the camera
  EXPECT_FALSE(view.See({3.3, 0.5, 5.1}, 0.02));          // right of the image
  EXPECT_FALSE(view.See({-3.3, 0.5, 5.1}, 0.02));
}

TEST(StaticView, DoesNotSeeThroughDistractors) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.distractor = DistractorMask(32, 24, 0.0f);
  prediction.distractor(22, 15) = 0.9f;  // pixels [44, 46) x [30, 32)
  const StaticView view(prediction, kThreshold);
  EXPECT_FALSE(view.See({1.05, 0.55, 5.1}, 0.02));  // at (44.6, 30.6)
  EXPECT_TRUE(view.See({0.95, 0.55, 5.1}, 0.02));   // at (43.4, 30.6)
}

TEST(StaticView, TakesDepthFromPointsWhereThereIsNoDepth) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.view.cam_from_world.translation = {0.0, 0.0, 1.0};
  prediction.depth = DepthMap();
  prediction.points = Grid<Eigen::Vector3f>(32, 24, Eigen::Vector3f(0.0f, 0.0f, 4.1f));
  prediction.points(0, 0) = Eigen::Vector3f(0.0f, 0.0f, -2.0f);  // behind the camera
  prediction.points(1, 0) = Eigen::Vector3f::Constant(kNaN);
  const std::vector<StaticView::Point> points =
      StaticView(prediction, kThreshold).StaticPoints(0.0);
  ASSERT_EQ(points.size(), 32u * 24u - 2u);
  for (const StaticView::Point& point : points) EXPECT_NEAR(point.xyz.z(), 4.1, 1e-6);
}

TEST(StaticView, SamplesGivePointsAndAgreeNearby) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth = DepthMap();
  prediction.depth_samples = {{{44.2f, 30.2f}, 5.1f, 2.0f}, {{10.0f, 10.0f}, 5.1f, 1.0f}};
  const StaticView view(prediction, kThreshold);
  ASSERT_EQ(view.StaticPoints(0.0).size(), 2u);
  ASSERT_EQ(view.StaticPoints(1.5).size(), 1u);
  EXPECT_LT((view.StaticPoints(1.5)[0].xyz - Eigen::Vector3d(12.2 / 12.0, 6.2 / 12.0, 5.1)).norm(),
            1e-6);
  // Bins are 64 / 128 pixels wide: the sample counts up to one bin beside its own.
  EXPECT_TRUE(view.See({1.0, 0.5, 5.1}, 0.02));
  EXPECT_TRUE(view.See({12.9 / 12.0, 0.5, 5.1}, 0.02));
  EXPECT_FALSE(view.See({13.1 / 12.0, 0.5, 5.1}, 0.02));
  EXPECT_FALSE(view.See({1.0, 0.5, 5.1 * 1.05}, 0.02));
  ConfidenceHistogram histogram;
  view.AddConfidencesTo(histogram);
  EXPECT_EQ(histogram.count(), 2u);

  prediction.distractor = DistractorMask(32, 24, 0.0f);
  prediction.distractor(22, 15) = 0.9f;
  EXPECT_EQ(StaticView(prediction, kThreshold).StaticPoints(0.0).size(), 1u);
}

TEST(StaticView, DepthIsThatOfTheMapOnStaticPixels) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth(4, 4) = 6.0f;  // a depth edge for its neighbours
  prediction.depth_conf = ConfidenceMap(32, 24, 3.0f);
  prediction.depth_conf(20, 10) = 7.0f;
  prediction.distractor = DistractorMask(32, 24, 0.1f);
  prediction.distractor(10, 10) = 0.9f;
  const StaticView view(prediction, kThreshold);
  const auto depth = view.DepthAt({41.0, 21.0});  // network (20.5, 10.5)
  ASSERT_TRUE(depth);
  EXPECT_FLOAT_EQ(depth->depth, 5.1f);
  EXPECT_EQ(depth->confidence, 7.0f);
  EXPECT_FALSE(view.DepthAt({21.0, 21.0}));  // on the distractor
  EXPECT_FALSE(view.DepthAt({8.0, 8.0}));    // on the edge
  EXPECT_FALSE(view.DepthAt({-1.0, 8.0}));
}

TEST(StaticView, DepthIsThatOfTheNearestSample) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth = {};
  prediction.depth_samples = {{{10.0f, 10.0f}, 2.0f, 1.5f}, {{10.6f, 10.0f}, 3.0f, 2.5f}};
  const StaticView view(prediction, kThreshold);
  ASSERT_TRUE(view.DepthAt({10.2, 10.0}));
  EXPECT_EQ(view.DepthAt({10.2, 10.0})->depth, 2.0f);
  EXPECT_EQ(view.DepthAt({10.4, 10.0})->depth, 3.0f);
  EXPECT_EQ(view.DepthAt({10.4, 10.0})->confidence, 2.5f);
  EXPECT_FALSE(view.DepthAt({14.0, 10.0}));  // farther than 1 % of 64 px
}

}  // namespace
}  // namespace vgtw
