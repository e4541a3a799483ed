// SPDX-License-Identifier: BSD-3-Clause
#include "scene/depth_map.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// Rounding of depths of size 4 that are stored as float.
constexpr double kFloatRounding = 4e-7;

double Plane(double x, double y) { return 3.0 + 0.01 * x + 0.02 * y; }

DepthMap MakePlane() {
  DepthMap depth(8, 6);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) depth(x, y) = static_cast<float>(Plane(x + 0.5, y + 0.5));
  }
  return depth;
}

TEST(SampleDepth, IsExactOnAPlane) {
  const DepthMap depth = MakePlane();
  for (double y = 0.5; y <= 5.5; y += 0.25) {
    for (double x = 0.5; x <= 7.5; x += 0.25) {
      EXPECT_NEAR(SampleDepth(depth, {x, y}).value(), Plane(x, y), kFloatRounding);
    }
  }
}

TEST(SampleDepth, GivesTheStoredValueAtAPixelsCentre) {
  DepthMap depth(3, 3, kUnknown);
  depth(1, 1) = 7.0f;
  EXPECT_EQ(SampleDepth(depth, {1.5, 1.5}), 7.0);
}

TEST(SampleDepth, IsConstantWithinHalfAPixelOfTheBorder) {
  const DepthMap depth = MakePlane();
  EXPECT_EQ(SampleDepth(depth, {0.0, 0.0}), depth(0, 0));
  EXPECT_EQ(SampleDepth(depth, {7.9, 5.9}), depth(7, 5));
}

TEST(SampleDepth, HasNothingOutside) {
  const DepthMap depth = MakePlane();
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(-0.1, 1.0), {8.0, 1.0}, {1.0, -0.1}, {1.0, 6.0}, {std::nan(""), 1.0}}) {
    EXPECT_FALSE(SampleDepth(depth, pixel)) << pixel.transpose();
  }
  EXPECT_FALSE(SampleDepth(DepthMap(), {0.0, 0.0}));
}

TEST(SampleDepth, HasNothingNextToUnknownDepth) {
  for (const float unknown : {kUnknown, 0.0f, -1.0f, std::numeric_limits<float>::infinity()}) {
    DepthMap depth = MakePlane();
    depth(3, 2) = unknown;
    EXPECT_FALSE(SampleDepth(depth, {3.5, 2.5}));
    EXPECT_FALSE(SampleDepth(depth, {2.6, 2.5}));
    EXPECT_FALSE(SampleDepth(depth, {4.4, 3.4}));
    EXPECT_TRUE(SampleDepth(depth, {2.5, 2.5}));
    EXPECT_TRUE(SampleDepth(depth, {4.6, 2.5}));
  }
}

TEST(SampleDepth, HasNothingAcrossADepthEdge) {
  DepthMap depth(2, 1, 1.0f);
  depth(1, 0) = 1.04f;
  EXPECT_NEAR(SampleDepth(depth, {1.0, 0.5}).value(), 1.02, kFloatRounding);
  EXPECT_FALSE(SampleDepth(depth, {1.0, 0.5}, 0.03));
  depth(1, 0) = 1.06f;
  EXPECT_FALSE(SampleDepth(depth, {1.0, 0.5}));
  EXPECT_EQ(SampleDepth(depth, {0.5, 0.5}), 1.0);
}

View MakeView() {
  View view;
  view.camera = MakePinhole(100, 80, 100, 100);
  view.network_width = 50;
  view.network_height = 40;
  view.original_from_network << 2, 0, 0, 0, 2, 0;
  view.cam_from_world = {RotationAboutAxis(Eigen::Vector3d::UnitZ(), 90.0), {1, 2, 3}};
  return view;
}

TEST(UnprojectPixel, GivesAHandComputedPoint) {
  // Centre (10.5, 20.5) is (21, 41) in the original, ray (-0.29, 0.01), at depth 2
  // (-0.58, 0.02, 2) in the camera; less the translation (-1.58, -1.98, -1), turned back by 90
  // degrees (x, y) -> (y, -x).
  DepthMap depth(50, 40, kUnknown);
  depth(10, 20) = 2.0f;
  const auto point = UnprojectPixel(MakeView(), depth, 10, 20);
  ASSERT_TRUE(point);
  EXPECT_LT((*point - Eigen::Vector3d(-1.98, 1.58, -1.0)).norm(), 1e-14);
  EXPECT_FALSE(UnprojectPixel(MakeView(), depth, 11, 20));
  EXPECT_THROW(UnprojectPixel(MakeView(), depth, 50, 20), std::invalid_argument);
}

TEST(UnprojectPixel, ProjectsBackToThePixel) {
  View view = MakeView();
  view.camera.model = CameraModel::kSimpleRadial;
  view.camera.params = {100, 51, 39, -0.15};
  const DepthMap depth(50, 40, 3.0f);
  for (int y = 0; y < 40; y += 3) {
    for (int x = 0; x < 50; x += 3) {
      const Eigen::Vector3d point_in_cam =
          view.cam_from_world * UnprojectPixel(view, depth, x, y).value();
      EXPECT_NEAR(point_in_cam.z(), 3.0, 1e-14);
      // The bound of Unproject.
      EXPECT_LT((Project(view.camera, point_in_cam).value() -
                 Apply(view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5)))
                    .norm(),
                1e-10);
    }
  }
}

TEST(DepthFromPoints, UndoesUnprojectPixel) {
  const View view = MakeView();
  DepthMap depth(50, 40, 2.5f);
  depth(3, 4) = kUnknown;
  Grid<Eigen::Vector3f> points(50, 40, Eigen::Vector3f::Constant(kUnknown));
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 50; ++x) {
      if (const auto point = UnprojectPixel(view, depth, x, y)) points(x, y) = point->cast<float>();
    }
  }
  // In the camera's plane, as its translation along z is 3.
  points(5, 6) = {0.0f, 0.0f, -3.0f};
  const DepthMap result = DepthFromPoints(view, points);
  EXPECT_TRUE(std::isnan(result(3, 4)));
  EXPECT_TRUE(std::isnan(result(5, 6)));
  EXPECT_NEAR(result(49, 39), 2.5f, kFloatRounding);
}

}  // namespace
}  // namespace vgtw
