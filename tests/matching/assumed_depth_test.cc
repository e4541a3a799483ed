// SPDX-License-Identifier: BSD-3-Clause
#include "matching/assumed_depth.h"

#include "scene/random.h"
#include "scene/synthetic.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

View MakeView(const Rigid3d& cam_from_world) {
  View view;
  view.camera = MakePinhole(640, 480, 600.0, 600.0);
  view.cam_from_world = cam_from_world;
  return view;
}

std::vector<View> MakeOrbit(int num_views, double radius, double angle_error_deg) {
  std::vector<View> views;
  RandomStream random(1);
  for (int i = 0; i < num_views; ++i) {
    const double angle_rad = 2.0 * std::numbers::pi * i / num_views;
    const Eigen::Vector3d centre(
        radius * std::cos(angle_rad), radius * std::sin(angle_rad), 0.2 * radius);
    Rigid3d cam_from_world = LookAt(centre, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d axis = random.NormalVector().normalized();
    const Rigid3d error{RotationAboutAxis(axis, random.Normal() * angle_error_deg), {0, 0, 0}};
    views.push_back(MakeView(error * cam_from_world));
  }
  return views;
}

TEST(AssumedDepth, IsWhereTheAxesOfAnOrbitMeet) {
  // sqrt(1 + 0.2^2) from the centre of a circle of radius 1, at height 0.2.
  EXPECT_NEAR(AssumedDepth(MakeOrbit(36, 3.0, 0.0)), 3.0 * std::sqrt(1.04), 1e-6);
  // Axes that miss it by 2 deg, 3.5 % of the radius, meet within a tenth of it (median).
  EXPECT_NEAR(AssumedDepth(MakeOrbit(36, 3.0, 2.0)), 3.0 * std::sqrt(1.04), 0.3);
}

TEST(AssumedDepth, OfParallelViewsFollowsTheirDistances) {
  std::vector<View> views;
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 7; ++x) views.push_back(MakeView({{1, 0, 0, 0}, {-0.3 * x, -0.3 * y, 0}}));
  }
  // Of the 25 inner ones, the 8th nearest is 0.3 * sqrt(2) away, of the 20 at edges (not in
  // corners) it is 0.6: the median is an inner one's. Half of 640 px at f = 600 is 2 * 600 / 640 of
  // that.
  EXPECT_NEAR(AssumedDepth(views), 4.0 * 600.0 / 640.0 * 0.3 * std::sqrt(2.0), 1e-9);
}

TEST(AssumedDepth, ScalesWithTheWorld) {
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    std::vector<View> views = SyntheticScene({.path = path, .num_views = 20}).views();
    const double depth = AssumedDepth(views);
    for (View& view : views) view.cam_from_world.translation *= 10.0;
    EXPECT_NEAR(AssumedDepth(views), 10.0 * depth, 1e-9 * depth);
  }
}

TEST(AssumedDepth, IsOfTheOrderOfTheTrueDepth) {
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    const SyntheticScene scene({.path = path, .num_views = 20});
    const Prediction truth = MakeTruePrediction(scene, 70);
    std::vector<double> ratios;
    for (const ViewPrediction& view : truth.views) {
      for (const float depth : view.depth.data()) {
        if (std::isfinite(depth)) ratios.push_back(depth);
      }
    }
    std::sort(ratios.begin(), ratios.end());
    const double ratio = AssumedDepth(scene.views()) / ratios[ratios.size() / 2];
    // Nothing but poses is known: a factor of 5, at the ends of the range of 1/2 to 2 for which
    // points are assumed 2.5.
    EXPECT_GT(ratio, 0.2) << static_cast<int>(path);
    EXPECT_LT(ratio, 5.0) << static_cast<int>(path);
  }
}

TEST(AssumedDepth, IsOneWhereAllStandAtOnePlace) {
  EXPECT_EQ(AssumedDepth({}), 1.0);
  EXPECT_EQ(AssumedDepth({MakeView({})}), 1.0);
  EXPECT_EQ(AssumedDepth({MakeView({}), MakeView({})}), 1.0);
}

}  // namespace
}  // namespace vgtw
