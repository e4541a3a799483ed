// SPDX-License-Identifier: BSD-3-Clause
#include "scene/triangulation_angle.h"

#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(TriangulationAngleDeg, IsTheLargestAngleByHand) {
  const std::vector<Eigen::Vector3d> centres = {{-1.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}};
  const Eigen::Vector3d point(0.0, 0.0, 1.0);
  EXPECT_NEAR(TriangulationAngleDeg(centres, point), 90.0, 1e-12);
  EXPECT_NEAR(TriangulationAngleDeg(std::span(centres).first(2), point), 45.0, 1e-12);
  EXPECT_EQ(TriangulationAngleDeg(centres, point, 30.0), 30.0);
  EXPECT_NEAR(TriangulationAngleDeg(centres, point, 91.0), 90.0, 1e-12);
  EXPECT_NEAR(TriangulationAngleDeg(centres, {0.5, 0.0, 0.0}), 180.0, 1e-12);
  EXPECT_EQ(TriangulationAngleDeg(std::span(centres).first(1), point), 0.0);
}

}  // namespace
}  // namespace vgtw
