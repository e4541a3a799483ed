// SPDX-License-Identifier: BSD-3-Clause
#include "scene/statistics.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(Median, OfOddAndEvenNumbersOfValues) {
  EXPECT_EQ(Median({5.0, 1.0, 3.0}), 3.0);
  EXPECT_EQ(Median({4.0, 1.0, 3.0, 10.0}), 3.5);
  EXPECT_EQ(Median({7.0}), 7.0);
}

TEST(Percentile, InterpolatesBetweenNeighbours) {
  const std::vector<double> values = {40.0, 10.0, 30.0, 20.0, 50.0};
  EXPECT_EQ(Percentile(values, 0.0), 10.0);
  EXPECT_EQ(Percentile(values, 100.0), 50.0);
  EXPECT_EQ(Percentile(values, 25.0), 20.0);
  // Rank 0.9 * 4 = 3.6: 40 + 0.6 * 10.
  EXPECT_DOUBLE_EQ(Percentile(values, 90.0), 46.0);
}

TEST(Percentile, RefusesNothingAndPercentOutsideItsRange) {
  EXPECT_THROW(Percentile({}, 50.0), std::invalid_argument);
  EXPECT_THROW(Percentile({1.0}, -1.0), std::invalid_argument);
  EXPECT_THROW(Percentile({1.0}, 100.1), std::invalid_argument);
}

TEST(Diameter, IsTheLargestDistance) {
  EXPECT_EQ(Diameter({}), 0.0);
  EXPECT_EQ(Diameter({{1.0, 2.0, 3.0}}), 0.0);
  EXPECT_EQ(Diameter({{0.0, 0.0, 0.0}, {1.0, 1.0, 0.0}, {3.0, 0.0, 4.0}}), 5.0);
}

}  // namespace
}  // namespace vgtw
