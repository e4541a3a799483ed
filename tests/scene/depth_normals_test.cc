// SPDX-License-Identifier: BSD-3-Clause
#include "scene/depth_normals.h"

#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

View MakeView(CameraModel model = CameraModel::kPinhole) {
  View view;
  view.camera = MakePinhole(64, 48, 60.0, 50.0);
  if (model == CameraModel::kSimpleRadial) {
    view.camera.model = model;
    view.camera.params = {60.0, 32.0, 24.0, -0.1};
  }
  view.network_width = 32;
  view.network_height = 24;
  view.original_from_network << 2.0, 0.0, 0.0, 0.0, 2.0, 0.0;
  return view;
}

// z-depths of the plane normal . point = offset, in camera coordinates.
DepthMap DepthOfPlane(const View& view, const Eigen::Vector3d& normal, double offset) {
  DepthMap depth(view.network_width, view.network_height);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const auto ray = Unproject(
          view.camera, Apply(view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5)));
      depth(x, y) = static_cast<float>(offset / normal.dot(ray->homogeneous()));
    }
  }
  return depth;
}

TEST(NormalsFromDepth, OfAPlaneIsItsNormalTowardsTheCamera) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.4, -1.2).normalized();
  for (const CameraModel model : {CameraModel::kPinhole, CameraModel::kSimpleRadial}) {
    const View view = MakeView(model);
    const Grid<Eigen::Vector3f> normals = NormalsFromDepth(view, DepthOfPlane(view, normal, -5.0));
    ASSERT_EQ(normals.width(), 32);
    ASSERT_EQ(normals.height(), 24);
    for (const Eigen::Vector3f& of_pixel : normals.data()) {
      // Depths are floats: 5e-7 of 5 over a step of 0.17 between pixels.
      EXPECT_LT((of_pixel - normal.cast<float>()).norm(), 1e-5f);
    }
  }
}

// The left half lies at 2, the right at 5: every normal is that of its own wall.
TEST(NormalsFromDepth, NothingIsJoinedAcrossADepthEdge) {
  const View view = MakeView();
  DepthMap depth(32, 24, 2.0f);
  for (int y = 0; y < 24; ++y) {
    for (int x = 16; x < 32; ++x) depth(x, y) = 5.0f;
  }
  const Grid<Eigen::Vector3f> normals = NormalsFromDepth(view, depth);
  for (const Eigen::Vector3f& normal : normals.data()) {
    EXPECT_LT((normal - Eigen::Vector3f(0.0f, 0.0f, -1.0f)).norm(), 1e-6f);
  }
}

TEST(NormalsFromDepth, UnknownWhereDepthIsOrNothingIsLeftToCompareWith) {
  const View view = MakeView();
  DepthMap depth(32, 24, kNan);
  depth(5, 5) = depth(6, 5) = depth(7, 5) = 3.0f;  // a row alone
  depth(20, 10) = depth(21, 10) = depth(20, 11) = 3.0f;
  const Grid<Eigen::Vector3f> normals = NormalsFromDepth(view, depth);
  EXPECT_EQ(normals(6, 5), Eigen::Vector3f::Zero());
  EXPECT_EQ(normals(0, 0), Eigen::Vector3f::Zero());
  EXPECT_EQ(normals(21, 10), Eigen::Vector3f::Zero());
  EXPECT_LT((normals(20, 10) + Eigen::Vector3f::UnitZ()).norm(), 1e-6f);
  EXPECT_TRUE(NormalsFromDepth(view, {}).empty());
}

}  // namespace
}  // namespace vgtw
