// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/voxel_grid.h"

#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(MergeInVoxels, GivesTheMeanOfEachCube) {
  const std::vector<ColoredPoint> merged = MergeInVoxels({{{0.25f, 0.5f, 0.5f}, {10, 20, 30}},
                                                          {{0.75f, 0.5f, 0.0f}, {30, 40, 90}},
                                                          {{-0.25f, 0.5f, 0.5f}, {1, 2, 3}}});
  ASSERT_EQ(merged.size(), 2u);
  EXPECT_EQ(merged[0].xyz, Eigen::Vector3f(-0.25f, 0.5f, 0.5f));
  EXPECT_EQ(merged[0].rgb, (std::array<uint8_t, 3>{1, 2, 3}));
  EXPECT_EQ(merged[1].xyz, Eigen::Vector3f(0.5f, 0.5f, 0.25f));
  EXPECT_EQ(merged[1].rgb, (std::array<uint8_t, 3>{20, 30, 60}));
}

TEST(MergeInVoxels, LeavesOnePointPerOccupiedCubeOfALargeScene) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  std::vector<ColoredPoint> points;
  std::set<std::tuple<float, float, float>> cubes;
  for (int i = 0; i < 20000; ++i) {
    // From a dense cloud around the origin out to where a 32-bit number of cells cannot reach.
    const float size = i % 2 == 0 ? 10.0f : 50000.0f;
    const Eigen::Vector3f xyz(size * normal(random), size * normal(random), size * normal(random));
    points.push_back({xyz, {0, 0, 0}});
    cubes.insert({std::floor(xyz.x()), std::floor(xyz.y()), std::floor(xyz.z())});
  }
  const std::vector<ColoredPoint> merged = MergeInVoxels(points);
  EXPECT_EQ(merged.size(), cubes.size());
  EXPECT_LT(cubes.size(), points.size() - 500);
}

TEST(MergeInVoxels, LeavesOutWhatFloatsCannotResolve) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(
      MergeInVoxels({{{nan, 0, 0}, {}}, {{0, infinity, 0}, {}}, {{0, 0, 1e7f}, {}}}).empty());
  EXPECT_TRUE(MergeInVoxels({}).empty());
  EXPECT_EQ(MergeInVoxels({{{0, 0, 8e6f}, {}}}).size(), 1u);
}

}  // namespace
}  // namespace vgtw
