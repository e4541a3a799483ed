// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/mask_score.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A mask of 60 x 40 that excludes columns [x0, x1) of rows [y0, y1).
StaticMask Excluding(int x0, int x1, int y0, int y1) {
  StaticMask mask(60, 40, 255);
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) mask(x, y) = 0;
  }
  return mask;
}

StaticMask Inverted(StaticMask mask) {
  for (uint8_t& value : mask.data()) value = static_cast<uint8_t>(255 - value);
  return mask;
}

const StaticMask kEmpty(60, 40, 255);
const StaticMask kBox = Excluding(10, 30, 10, 20);

// Truth 20 x 10 pixels at x = 10, prediction the same 5 to the right: 150 common, 50 only in each.
TEST(ScoreMask, RatiosByHand) {
  const MaskScore score = ScoreMask(Excluding(15, 35, 10, 20), kBox, 0.0);
  EXPECT_EQ(score.pixels.true_positive, 150u);
  EXPECT_EQ(score.pixels.false_positive, 50u);
  EXPECT_EQ(score.pixels.false_negative, 50u);
  EXPECT_EQ(score.pixels.true_negative, 60u * 40u - 250u);
  const MaskRatios ratios = RatiosOf(score);
  EXPECT_DOUBLE_EQ(ratios.accuracy, 2300.0 / 2400.0);
  EXPECT_DOUBLE_EQ(ratios.precision, 0.75);
  EXPECT_DOUBLE_EQ(ratios.recall, 0.75);
  EXPECT_DOUBLE_EQ(ratios.iou, 150.0 / 250.0);
  EXPECT_DOUBLE_EQ(ratios.dice, 0.75);
}

// Twice as many predicted pixels, all true ones among them: P = 1/2, R = 1, F1 = Dice = 2/3.
TEST(ScoreMask, TooMuchCostsPrecisionTooLittleRecall) {
  const StaticMask larger = Excluding(10, 50, 10, 20);
  const MaskRatios too_much = RatiosOf(ScoreMask(larger, kBox, 0.0));
  const MaskRatios too_little = RatiosOf(ScoreMask(kBox, larger, 0.0));
  EXPECT_DOUBLE_EQ(too_much.precision, 0.5);
  EXPECT_DOUBLE_EQ(too_much.recall, 1.0);
  EXPECT_DOUBLE_EQ(too_little.precision, 1.0);
  EXPECT_DOUBLE_EQ(too_little.recall, 0.5);
  EXPECT_DOUBLE_EQ(too_much.f1, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(too_little.dice, 2.0 / 3.0);
  EXPECT_DOUBLE_EQ(too_little.iou, 0.5);
}

void ExpectAll(const MaskRatios& ratios, double value) {
  EXPECT_EQ(ratios.precision, value);
  EXPECT_EQ(ratios.recall, value);
  EXPECT_EQ(ratios.f1, value);
  EXPECT_EQ(ratios.iou, value);
  EXPECT_EQ(ratios.dice, value);
  EXPECT_EQ(ratios.boundary_f, value);
}

TEST(ScoreMask, APerfectMaskScoresOneAlsoWhereNothingIsToBeFound) {
  for (const StaticMask& mask : {kBox, kEmpty, Inverted(kEmpty)}) {
    const MaskRatios ratios = RatiosOf(ScoreMask(mask, mask, 0.0));
    ExpectAll(ratios, 1.0);
    EXPECT_EQ(ratios.accuracy, 1.0);
  }
}

TEST(ScoreMask, OneEmptyMaskScoresZero) {
  ExpectAll(RatiosOf(ScoreMask(kEmpty, kBox, 5.0)), 0.0);
  ExpectAll(RatiosOf(ScoreMask(kBox, kEmpty, 5.0)), 0.0);
  EXPECT_DOUBLE_EQ(RatiosOf(ScoreMask(kBox, kEmpty, 5.0)).accuracy, 2200.0 / 2400.0);
}

// Inverted polarity finds every outline and no pixel: the pair of figures that gives it away.
TEST(ScoreMask, AnInvertedMaskHasNoPixelAndEveryOutline) {
  const MaskRatios ratios = RatiosOf(ScoreMask(Inverted(kBox), kBox, 0.0));
  EXPECT_EQ(ratios.accuracy, 0.0);
  EXPECT_EQ(ratios.iou, 0.0);
  EXPECT_EQ(ratios.dice, 0.0);
  EXPECT_EQ(ratios.boundary_f, 1.0);
}

TEST(ScoreMask, SwappedMasksSwapPrecisionAndRecallOnly) {
  const StaticMask a = Excluding(3, 25, 2, 31);
  const StaticMask b = Excluding(7, 40, 11, 33);
  const MaskRatios ab = RatiosOf(ScoreMask(a, b, 2.0));
  const MaskRatios ba = RatiosOf(ScoreMask(b, a, 2.0));
  EXPECT_EQ(ab.precision, ba.recall);
  EXPECT_EQ(ab.recall, ba.precision);
  EXPECT_EQ(ab.dice, ba.dice);
  EXPECT_EQ(ab.iou, ba.iou);
  EXPECT_DOUBLE_EQ(ab.boundary_f, ba.boundary_f);
}

// Of a box of w x h: the h + 1 pixels left of it, from the one above its corner on; the w above it;
// its own last column (h) and last row (w - 1, the corner is counted): 2 (w + h).
TEST(ScoreMask, OutlinesByHand) {
  const MaskScore score = ScoreMask(kBox, kEmpty, 0.0);
  EXPECT_EQ(score.boundary.num_predicted, 2u * (20 + 10));
  EXPECT_EQ(score.boundary.num_true, 0u);
  // Where it touches the image's border there is no outline: h + w - 1 are left.
  EXPECT_EQ(ScoreMask(Excluding(0, 20, 0, 10), kEmpty, 0.0).boundary.num_predicted, 20u + 10u - 1u);
}

TEST(ScoreMask, AShiftWithinTheToleranceKeepsTheBoundaryPerfect) {
  for (int shift = 1; shift <= 6; ++shift) {
    const StaticMask moved = Excluding(10 + shift, 30 + shift, 10, 20);
    const MaskScore within = ScoreMask(moved, kBox, shift);
    EXPECT_EQ(within.boundary.F(), 1.0) << shift;
    const MaskScore beyond = ScoreMask(moved, kBox, shift - 0.01);
    EXPECT_LT(beyond.boundary.F(), 1.0) << shift;
    EXPECT_GT(beyond.boundary.F(), 0.0) << shift;
  }
}

// Shifted by (3, 4), a corner is 5 px from its true place: discs, not squares, decide.
TEST(ScoreMask, TheToleranceIsEuclidean) {
  const StaticMask moved = Excluding(13, 14, 14, 15);
  const StaticMask dot = Excluding(10, 11, 10, 11);
  EXPECT_EQ(ScoreMask(moved, dot, 5.0).boundary.F(), 1.0);
  // The outline of a pixel is itself and its three neighbours above and left; without the disc of 5
  // the farthest of them have no partner.
  EXPECT_LT(ScoreMask(moved, dot, 4.9).boundary.F(), 1.0);
  EXPECT_EQ(ScoreMask(moved, dot, 2.0).boundary.F(), 0.0);
  EXPECT_EQ(ScoreMask(moved, dot, 1e12).boundary.F(), 1.0);
}

TEST(ScoreMask, DefaultToleranceIsThatOfDavis) {
  EXPECT_EQ(DefaultBoundaryTolerancePx(854, 480), 8.0);  // 0.008 * 979.7 = 7.84
  EXPECT_EQ(DefaultBoundaryTolerancePx(1600, 1200), 16.0);
}

TEST(ScoreMask, FeaturesByHand) {
  const StaticMask predicted = Excluding(20, 40, 10, 20);
  const std::vector<Eigen::Vector2d> features = {
      {5.0, 5.0},     // static, kept
      {10.0, 10.0},   // distractor, kept
      {19.99, 15.0},  // distractor, kept
      {25.0, 15.0},   // distractor, excluded
      {35.0, 19.9},   // static, excluded
      {60.0, 5.0},    // outside: excluded by both
  };
  const MaskScore score = ScoreMask(predicted, kBox, 0.0, features);
  EXPECT_EQ(score.features.num_kept, 3u);
  EXPECT_EQ(score.features.num_kept_on_distractors, 2u);
  EXPECT_EQ(score.features.num_static, 2u);
  EXPECT_EQ(score.features.num_static_lost, 1u);
  EXPECT_DOUBLE_EQ(score.features.OnDistractorsPer1000Kept(), 2000.0 / 3.0);
  EXPECT_DOUBLE_EQ(score.features.LostPer1000Static(), 500.0);
  EXPECT_EQ(FeatureCounts{}.OnDistractorsPer1000Kept(), 0.0);
  const MaskRatios mean = MeanRatios({score, MaskScore{}});
  EXPECT_DOUBLE_EQ(mean.on_distractors_per_1000_kept, 1000.0 / 3.0);
  EXPECT_DOUBLE_EQ(mean.lost_per_1000_static, 250.0);
}

// Images of Dice 1 and 0 have a mean of 1/2; pooled, the larger one decides.
TEST(ScoreMask, MeanWeighsImagesPooledWeighsPixels) {
  const MaskScore small_missed = ScoreMask(kEmpty, Excluding(0, 1, 0, 1), 0.0);
  const MaskScore large_found = ScoreMask(kBox, kBox, 0.0);
  EXPECT_DOUBLE_EQ(MeanRatios({small_missed, large_found}).dice, 0.5);
  MaskScore pooled = small_missed;
  pooled += large_found;
  EXPECT_DOUBLE_EQ(RatiosOf(pooled).dice, 400.0 / 401.0);
  EXPECT_DOUBLE_EQ(RatiosOf(pooled).recall, 200.0 / 201.0);
  EXPECT_EQ(pooled.boundary.num_true,
            small_missed.boundary.num_true + large_found.boundary.num_true);
}

TEST(ScoreMask, RefusesMasksOfDifferentSizes) {
  EXPECT_THROW(ScoreMask(StaticMask(40, 60, 255), kBox, 1.0), std::invalid_argument);
  EXPECT_THROW(ScoreMask(kBox, kBox, std::nan("")), std::invalid_argument);
  EXPECT_THROW(MeanRatios({}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
