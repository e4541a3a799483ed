// SPDX-License-Identifier: BSD-3-Clause
#include "scene/grid.h"

#include <stdexcept>

#include <Eigen/Core>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(Grid, IsRowMajor) {
  Grid<int> grid(3, 2, 7);
  grid(2, 0) = 1;
  grid(0, 1) = 2;
  EXPECT_THAT(grid.data(), testing::ElementsAre(7, 7, 1, 2, 7, 7));
}

TEST(Grid, StartsAtZeroAlsoForVectors) {
  EXPECT_THAT(Grid<float>(2, 2).data(), testing::Each(0.0f));
  EXPECT_THAT(Grid<Eigen::Vector3f>(2, 2).data(), testing::Each(Eigen::Vector3f(0, 0, 0)));
}

TEST(Grid, ContainsItsPixelsOnly) {
  const Grid<int> grid(3, 2);
  EXPECT_TRUE(grid.Contains(0, 0));
  EXPECT_TRUE(grid.Contains(2, 1));
  EXPECT_FALSE(grid.Contains(3, 1));
  EXPECT_FALSE(grid.Contains(2, 2));
  EXPECT_FALSE(grid.Contains(-1, 0));
  EXPECT_FALSE(grid.Contains(0, -1));
}

TEST(Grid, EqualityComparesShapeAndValues) {
  EXPECT_EQ(Grid<int>(3, 2, 1), Grid<int>(3, 2, 1));
  EXPECT_NE(Grid<int>(3, 2, 1), Grid<int>(2, 3, 1));
  EXPECT_NE(Grid<int>(3, 2, 1), Grid<int>(3, 2, 2));
}

TEST(Grid, RefusesNegativeSizes) {
  EXPECT_THROW(Grid<int>(-1, 2), std::invalid_argument);
  EXPECT_THROW(Grid<int>(1, -2), std::invalid_argument);
  EXPECT_TRUE(Grid<int>(0, 5).empty());
}

}  // namespace
}  // namespace vgtw
