// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/depth_error.h"

#include "tests/evaluation/made_clouds.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// made_depths() of golden/depth_error.py, the same up to the last bit.
DepthPairs MadeDepths() {
  DepthPairs pairs;
  for (int i = 0; i < 300; ++i) {
    const double expected = 1.0 + 4.0 * Fraction((i + 1) * 0.8191725134);
    const double predicted = 0.5 * expected + 0.4 + 0.2 * (Fraction((i + 1) * 0.6710436067) - 0.5);
    pairs.expected.push_back(expected);
    pairs.predicted.push_back(i % 10 == 9 ? 3.0 * predicted : predicted);
  }
  return pairs;
}

double SumOfDifferences(const DepthPairs& pairs, const DepthFit& fit) {
  double sum = 0.0;
  for (size_t i = 0; i < pairs.predicted.size(); ++i) {
    sum += std::abs(fit.scale * pairs.predicted[i] + fit.shift - pairs.expected[i]);
  }
  return sum;
}

TEST(FitDepth, EqualsScipy) {
  const nlohmann::json golden = ReadGolden("depth_error");
  const DepthPairs pairs = MadeDepths();
  for (const auto& [name, alignment] : {std::pair("none", DepthAlignment::kNone),
                                        std::pair("median", DepthAlignment::kMedian),
                                        std::pair("scale", DepthAlignment::kScale),
                                        std::pair("scale_shift", DepthAlignment::kScaleShift)}) {
    SCOPED_TRACE(name);
    const auto fit = FitDepth(pairs, alignment);
    ASSERT_TRUE(fit);
    // All are closed forms or end at a vertex, so that only rounding differs.
    EXPECT_NEAR(fit->scale, golden[name]["scale"].get<double>(), 1e-9);
    EXPECT_NEAR(fit->shift, golden[name]["shift"].get<double>(), 1e-9);
    const DepthError error = CompareDepths(pairs, *fit);
    EXPECT_EQ(error.num_pixels, 300u);
    EXPECT_NEAR(error.AbsRel(), golden[name]["abs_rel"].get<double>(), 1e-9);
    EXPECT_NEAR(error.WithinPercent(), golden[name]["within_percent"].get<double>(), 1e-9);
  }
}

TEST(FitDepth, NoOtherLineHasLessDifferences) {
  const DepthPairs pairs = MadeDepths();
  const auto best = FitDepth(pairs, DepthAlignment::kScaleShift);
  ASSERT_TRUE(best);
  for (const double scale_step : {-1e-3, 0.0, 1e-3}) {
    for (const double shift_step : {-1e-3, 0.0, 1e-3}) {
      EXPECT_LE(SumOfDifferences(pairs, *best),
                SumOfDifferences(pairs, {best->scale + scale_step, best->shift + shift_step}));
    }
  }
}

TEST(FitDepth, FindsTheMotionOfMostPixelsInSpiteOfTheOthers) {
  DepthPairs pairs;
  for (int i = 0; i < 100; ++i) {
    const double predicted = 1.0 + Fraction((i + 1) * 0.8191725134);
    pairs.predicted.push_back(predicted);
    pairs.expected.push_back(i % 4 == 0 ? 9.0 : 2.0 * predicted + 0.5);
  }
  const auto fit = FitDepth(pairs, DepthAlignment::kScaleShift);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->scale, 2.0, 1e-12);
  EXPECT_NEAR(fit->shift, 0.5, 1e-12);
}

TEST(FitDepth, ScaledPredictionsAreScaledBack) {
  DepthPairs pairs = MadeDepths();
  for (const DepthAlignment alignment :
       {DepthAlignment::kMedian, DepthAlignment::kScale, DepthAlignment::kScaleShift}) {
    const DepthFit fit = FitDepth(pairs, alignment).value();
    DepthPairs scaled = pairs;
    for (double& depth : scaled.predicted) depth *= 8.0;
    const DepthFit scaled_fit = FitDepth(scaled, alignment).value();
    EXPECT_NEAR(8.0 * scaled_fit.scale, fit.scale, 1e-12);
    EXPECT_NEAR(scaled_fit.shift, fit.shift, 1e-12);
  }
}

TEST(FitDepth, HasNoAnswerWhereThereIsNone) {
  EXPECT_FALSE(FitDepth({}, DepthAlignment::kMedian));
  EXPECT_FALSE(FitDepth({{2.0, 2.0}, {1.0, 3.0}}, DepthAlignment::kScaleShift));
  EXPECT_THROW(FitDepth({{2.0}, {}}, DepthAlignment::kNone), std::invalid_argument);
}

TEST(CompareDepths, CountsByHand) {
  // 1.2 and 2.5 for 2: 0.4 and 0.25 relative, only ratios below 1.25 are within.
  const DepthError error = CompareDepths({{1.2, 2.5, 2.4, 2.0}, {2.0, 2.0, 2.0, 2.0}}, {});
  EXPECT_NEAR(error.AbsRel(), (0.4 + 0.25 + 0.2 + 0.0) / 4.0, 1e-15);
  EXPECT_EQ(error.WithinPercent(), 50.0);
}

TEST(CompareDepths, DepthThatIsNotPositiveIsNotWithin) {
  EXPECT_EQ(CompareDepths({{1.0, 3.0}, {1.0, 1.0}}, {1.0, -2.0}).num_within, 1u);
}

TEST(CompareDepths, PoolingWeighsPixels) {
  DepthError pooled = CompareDepths({{2.0}, {1.0}}, {});
  pooled += CompareDepths({{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}}, {});
  EXPECT_EQ(pooled.AbsRel(), 0.25);
  EXPECT_EQ(pooled.WithinPercent(), 75.0);
  EXPECT_TRUE(std::isnan(DepthError().AbsRel()));
}

}  // namespace
}  // namespace vgtw
