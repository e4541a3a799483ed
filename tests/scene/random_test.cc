// SPDX-License-Identifier: BSD-3-Clause
#include "scene/random.h"

#include <cmath>
#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// The published first numbers of SplitMix64 for this seed.
TEST(RandomStream, IsSplitMix64) {
  RandomStream random(1234567);
  EXPECT_EQ(random.Bits(), 6457827717110365317u);
  EXPECT_EQ(random.Bits(), 3203168211198807973u);
  EXPECT_EQ(random.Bits(), 9817491932198370423u);
}

// Tolerances below are five standard errors of the mean of n draws.
TEST(RandomStream, UniformHasItsMeanAndVariance) {
  RandomStream random(3);
  constexpr int n = 100000;
  double sum = 0.0;
  double sum_of_squares = 0.0;
  for (int i = 0; i < n; ++i) {
    const double value = random.Uniform(-1.0, 3.0);
    ASSERT_GE(value, -1.0);
    ASSERT_LT(value, 3.0);
    sum += value;
    sum_of_squares += value * value;
  }
  const double variance = 16.0 / 12.0;
  EXPECT_NEAR(sum / n, 1.0, 5.0 * std::sqrt(variance / n));
  EXPECT_NEAR(sum_of_squares / n, variance + 1.0, 5.0 * 2.5 / std::sqrt(n));
}

// Five standard errors of n draws.
TEST(RandomStream, IndicesAndChancesHaveTheirShares) {
  RandomStream random(5);
  constexpr int n = 30000;
  int num_true = 0;
  std::vector<int> counts(3, 0);
  for (int i = 0; i < n; ++i) {
    ++counts.at(random.Index(3));
    num_true += random.Chance(0.2) ? 1 : 0;
  }
  for (const int count : counts) EXPECT_NEAR(count, n / 3, 5.0 * std::sqrt(n * 2.0 / 9.0));
  EXPECT_NEAR(num_true, 0.2 * n, 5.0 * std::sqrt(n * 0.16));
}

TEST(RandomStream, NormalHasItsMoments) {
  RandomStream random(4);
  constexpr int n = 100000;
  double sum = 0.0;
  double sum_of_squares = 0.0;
  double sum_of_fourth_powers = 0.0;
  for (int i = 0; i < n; ++i) {
    const double value = random.Normal();
    sum += value;
    sum_of_squares += value * value;
    sum_of_fourth_powers += value * value * value * value;
  }
  EXPECT_NEAR(sum / n, 0.0, 5.0 / std::sqrt(n));
  EXPECT_NEAR(sum_of_squares / n, 1.0, 5.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(sum_of_fourth_powers / n, 3.0, 5.0 * std::sqrt(96.0 / n));
}

TEST(RandomStream, RotationsHaveNoPreferredDirection) {
  RandomStream random(5);
  constexpr int n = 20000;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int i = 0; i < n; ++i) {
    const Eigen::Quaterniond rotation = random.Rotation();
    ASSERT_NEAR(rotation.norm(), 1.0, 1e-12);
    sum += rotation.toRotationMatrix();
  }
  // Every entry of a uniform rotation has mean 0 and variance 1/3.
  EXPECT_LT((sum / n).cwiseAbs().maxCoeff(), 5.0 / std::sqrt(3.0 * n));
}

TEST(HashKey, DependsOnEveryValueAndTheirOrder) {
  std::set<uint64_t> keys;
  for (uint64_t a = 0; a < 30; ++a) {
    keys.insert(HashKey({a}));
    for (uint64_t b = 0; b < 30; ++b) keys.insert(HashKey({a, b}));
  }
  EXPECT_EQ(keys.size(), 30u + 900u);
}

}  // namespace
}  // namespace vgtw
