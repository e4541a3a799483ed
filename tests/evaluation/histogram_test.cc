// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/histogram.h"

#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(MakeHistogram, CountsByHand) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Histogram histogram =
      MakeHistogram({1.99, 2.0, 2.49, 2.5, 3.49, 3.5, -7.0, nan, infinity}, 2.0, 0.5, 3);
  EXPECT_EQ(histogram.counts, (std::vector<size_t>{2, 1, 1}));
  EXPECT_THROW(MakeHistogram({}, 0.0, 0.0, 3), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
