// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/voxel_mean.h"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Points = std::vector<Eigen::Vector3d>;

TEST(MeanInVoxels, GivesTheMeanOfEveryOccupiedCube) {
  const Points points = {
      {0.1, 0.1, 0.1}, {5.0, 0.0, 0.0}, {0.3, 0.2, 0.4}, {-0.1, 0.1, 0.1}, {0.2, 0.3, 0.1}};
  const Points means = MeanInVoxels(points, 0.5);
  ASSERT_EQ(means.size(), 3u);
  EXPECT_EQ(means[0], points[3]);  // x < 0 comes first
  EXPECT_LT((means[1] - Eigen::Vector3d(0.2, 0.2, 0.2)).norm(), 1e-16);
  EXPECT_EQ(means[2], points[1]);
}

TEST(MeanInVoxels, LowerFacesBelongToACube) {
  EXPECT_EQ(MeanInVoxels({{0.5, 0.0, 0.0}, {0.75, 0.0, 0.0}, {0.4375, 0.0, 0.0}}, 0.5).size(), 2u);
}

TEST(MeanInVoxels, NothingGivesNothing) { EXPECT_TRUE(MeanInVoxels({}, 0.1).empty()); }

TEST(MeanInVoxels, RefusesWhatHasNoCube) {
  EXPECT_THROW(MeanInVoxels({{0.0, 0.0, 0.0}}, 0.0), std::invalid_argument);
  EXPECT_THROW(MeanInVoxels({{1e300, 0.0, 0.0}}, 1e-3), std::invalid_argument);
  EXPECT_THROW(MeanInVoxels({{std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0}}, 1.0),
               std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
