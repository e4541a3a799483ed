// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/voxel_means.h"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

SurfaceCloud MakePart(const ColoredPoint& point, const Eigen::Vector3f& normal, float confidence) {
  return {.points = {point}, .normals = {normal}, .scalars = {{"confidence", {confidence}}}};
}

// Three points of [0, 0.5)^3, one of [-0.5, 0) x [0, 0.5)^2; the cubes hold their lower faces.
TEST(VoxelMeans, EveryListBecomesTheMeanOfItsCube) {
  VoxelMeans means(0.5);
  means.Add(MakePart({{0.0f, 0.0f, 0.0f}, {10, 20, 30}}, {0.0f, 0.0f, -1.0f}, 1.0f));
  means.Add(MakePart({{0.25f, 0.25f, 0.0f}, {20, 20, 30}}, {0.0f, -1.0f, 0.0f}, 2.0f));
  means.Add(MakePart({{0.125f, 0.125f, 0.375f}, {31, 20, 30}}, {0.0f, 0.0f, 0.0f}, 6.0f));
  means.Add(MakePart({{-0.125f, 0.0f, 0.0f}, {1, 2, 3}}, {1.0f, 0.0f, 0.0f}, 9.0f));
  const SurfaceCloud cloud = means.Means();
  ASSERT_EQ(cloud.points.size(), 2u);
  EXPECT_EQ(cloud.points[0].xyz, Eigen::Vector3f(-0.125f, 0.0f, 0.0f));
  EXPECT_EQ(cloud.points[0].rgb, (std::array<uint8_t, 3>{1, 2, 3}));
  EXPECT_EQ(cloud.normals[0], Eigen::Vector3f::UnitX());
  EXPECT_EQ(cloud.points[1].xyz, Eigen::Vector3f(0.125f, 0.125f, 0.125f));
  EXPECT_EQ(cloud.points[1].rgb, (std::array<uint8_t, 3>{20, 20, 30}));
  EXPECT_LT((cloud.normals[1] - Eigen::Vector3f(0.0f, -std::sqrt(0.5f), -std::sqrt(0.5f))).norm(),
            1e-7f);
  ASSERT_EQ(cloud.scalars.size(), 1u);
  EXPECT_EQ(cloud.scalars[0].name, "confidence");
  EXPECT_EQ(cloud.scalars[0].values, (std::vector<float>{9.0f, 3.0f}));
}

TEST(VoxelMeans, OppositeNormalsAreUnknownAndOtherListsMayBeAbsent) {
  VoxelMeans means(1.0);
  means.Add(MakePart({{0.5f, 0.5f, 0.5f}, {}}, Eigen::Vector3f::UnitX(), 1.0f));
  means.Add(MakePart({{0.5f, 0.5f, 0.5f}, {}}, -Eigen::Vector3f::UnitX(), 1.0f));
  EXPECT_EQ(means.Means().normals[0], Eigen::Vector3f::Zero());
  VoxelMeans bare(1.0);
  bare.Add({.points = {{{0.5f, 0.5f, 0.5f}, {}}}, .normals = {}, .scalars = {}});
  EXPECT_TRUE(bare.Means().normals.empty());
  EXPECT_TRUE(bare.Means().scalars.empty());
  EXPECT_TRUE(VoxelMeans(1.0).Means().points.empty());
}

TEST(VoxelMeans, LeavesOutWhatIsNowhere) {
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  VoxelMeans means(1e-3);
  for (const float x : {nan, infinity, 1e30f}) {
    means.Add({.points = {{{x, 0.0f, 0.0f}, {}}}, .normals = {}, .scalars = {}});
  }
  EXPECT_TRUE(means.Means().points.empty());
  EXPECT_THROW(VoxelMeans(0.0), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
