// SPDX-License-Identifier: BSD-3-Clause
#include "scene/confidence_histogram.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(ConfidenceHistogram, KeepsTheWantedShare) {
  ConfidenceHistogram histogram;
  for (const float value : {1.0f, 2.0f, 4.0f, 8.0f}) histogram.Add(value);
  EXPECT_EQ(histogram.ThresholdKeeping(25.0), 8.0);
  EXPECT_EQ(histogram.ThresholdKeeping(50.0), 4.0);
  EXPECT_EQ(histogram.ThresholdKeeping(51.0), 2.0);
  EXPECT_EQ(histogram.ThresholdKeeping(100.0), 1.0);
  EXPECT_EQ(histogram.count(), 4u);
}

// Confidences of VGGT are 1 + exp(x); others lie within [0, 1].
TEST(ConfidenceHistogram, AgreesWithSortingUpToItsResolution) {
  std::mt19937 random(1);
  std::normal_distribution<float> normal(0.0f, 2.0f);
  std::uniform_real_distribution<float> uniform(0.97f, 1.0f);
  for (const bool is_narrow : {false, true}) {
    ConfidenceHistogram first, second;
    std::vector<float> values;
    for (int i = 0; i < 20000; ++i) {
      values.push_back(is_narrow ? uniform(random) : 1.0f + std::exp(normal(random)));
      (i % 3 == 0 ? first : second).Add(values.back());
    }
    first.Add(second);
    std::sort(values.begin(), values.end());
    for (const int percent : {5, 30, 50, 90}) {
      const double exact = values[values.size() * static_cast<size_t>(100 - percent) / 100];
      const double threshold = first.ThresholdKeeping(percent);
      EXPECT_LE(threshold, exact);
      EXPECT_GT(threshold, exact * (1.0 - 1.0 / 2048.0));
    }
  }
}

TEST(ConfidenceHistogram, TakesAnyValue) {
  ConfidenceHistogram histogram;
  EXPECT_EQ(histogram.ThresholdKeeping(50.0), 0.0);
  const float infinity = std::numeric_limits<float>::infinity();
  for (const float value : {-1.0f, -0.0f, 0.0f, infinity, std::nanf("")}) histogram.Add(value);
  EXPECT_EQ(histogram.count(), 4u);
  EXPECT_EQ(histogram.ThresholdKeeping(25.0), infinity);
  EXPECT_EQ(histogram.ThresholdKeeping(50.0), 0.0);
}

}  // namespace
}  // namespace vgtw
