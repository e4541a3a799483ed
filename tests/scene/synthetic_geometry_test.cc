// SPDX-License-Identifier: BSD-3-Clause
#include "scene/synthetic_geometry.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

Solid MakeSolid(ShapeKind kind) {
  return {kind, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), {1.0, 2.0, 3.0}};
}

double DepthOf(const Solid& solid,
               const Eigen::Vector3d& origin,
               const Eigen::Vector3d& direction) {
  return Intersect(solid, {origin, direction}).value_or(-1.0);
}

TEST(Intersect, CylinderIsMetAtItsMantleAndItsCaps) {
  const Solid cylinder = MakeSolid(ShapeKind::kCylinder);
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {-5.0, 0.0, 2.0}, {1.0, 0.0, 0.0}), 4.0);
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {0.0, -5.0, 2.0}, {0.0, 1.0, 0.0}), 3.0);
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {0.5, 1.0, 10.0}, {0.0, 0.0, -1.0}), 7.0);
  // Beside it, above it, through the corner of its enclosing box.
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {0.9, 1.9, 10.0}, {0.0, 0.0, -1.0}), -1.0);
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {-5.0, 0.0, 3.1}, {1.0, 0.0, 0.0}), -1.0);
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {-5.0, 1.9, 0.0}, {0.01, 0.0, 1.0}), -1.0);
  // From inside, and away from it.
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}), -1.0);
  EXPECT_DOUBLE_EQ(DepthOf(cylinder, {-5.0, 0.0, 2.0}, {-1.0, 0.0, 0.0}), -1.0);
}

TEST(Intersect, DomeIsMetFromInside) {
  const Solid dome = MakeSolid(ShapeKind::kDome);
  EXPECT_DOUBLE_EQ(DepthOf(dome, {0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}), 3.0);
  EXPECT_DOUBLE_EQ(DepthOf(dome, {0.5, 0.0, 0.0}, {-0.5, 0.0, 0.0}), 3.0);
}

TEST(DescribeSurface, NormalsPointToTheVisibleSide) {
  const Solid cylinder = MakeSolid(ShapeKind::kCylinder);
  EXPECT_EQ(DescribeSurface(cylinder, {1.0, 0.0, 2.9}).normal_in_world, Eigen::Vector3d::UnitX());
  EXPECT_EQ(DescribeSurface(cylinder, {0.1, 0.1, 3.0}).normal_in_world, Eigen::Vector3d::UnitZ());
  EXPECT_EQ(DescribeSurface(MakeSolid(ShapeKind::kDome), {0.0, 0.0, 3.0}).normal_in_world,
            -Eigen::Vector3d::UnitZ());
  EXPECT_EQ(DescribeSurface(MakeSolid(ShapeKind::kRoom), {0.0, -2.0, 0.0}).normal_in_world,
            Eigen::Vector3d::UnitY());
}

}  // namespace
}  // namespace vgtw
