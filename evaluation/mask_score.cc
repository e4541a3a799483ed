// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/mask_score.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace vgtw {
namespace {

// 1 = true, [H,W] as the masks.
using PixelSet = Grid<uint8_t>;

double Ratio(uint64_t part, uint64_t whole, double if_undefined) {
  return whole == 0 ? if_undefined : static_cast<double>(part) / static_cast<double>(whole);
}

double Per1000(uint64_t part, uint64_t whole) { return 1000.0 * Ratio(part, whole, 0.0); }

PixelCounts CountPixels(const StaticMask& predicted, const StaticMask& truth) {
  PixelCounts counts;
  for (size_t i = 0; i < truth.size(); ++i) {
    const bool is_predicted = predicted.data()[i] == 0;
    const bool is_true = truth.data()[i] == 0;
    counts.true_positive += is_predicted && is_true;
    counts.false_positive += is_predicted && !is_true;
    counts.false_negative += !is_predicted && is_true;
    counts.true_negative += !is_predicted && !is_true;
  }
  return counts;
}

PixelSet Outline(const StaticMask& mask) {
  PixelSet outline(mask.width(), mask.height());
  for (int y = 0; y < mask.height(); ++y) {
    const int below = std::min(y + 1, mask.height() - 1);
    for (int x = 0; x < mask.width(); ++x) {
      const int right = std::min(x + 1, mask.width() - 1);
      const bool is_excluded = mask(x, y) == 0;
      outline(x, y) = (mask(right, y) == 0) != is_excluded ||
                      (mask(x, below) == 0) != is_excluded ||
                      (mask(right, below) == 0) != is_excluded;
    }
  }
  return outline;
}

// Grows a set by a disc: row by row, so that the work is one run of bytes per pixel and row.
PixelSet Dilate(const PixelSet& set, double radius_px) {
  radius_px = std::min(radius_px, std::hypot(set.width(), set.height()));
  std::vector<int> half_widths;  // of the disc, in its rows 0, 1, ...
  for (int dy = 0; dy <= radius_px; ++dy) {
    half_widths.push_back(static_cast<int>(std::sqrt(radius_px * radius_px - dy * dy)));
  }
  const int reach = static_cast<int>(half_widths.size()) - 1;
  PixelSet dilated(set.width(), set.height());
  for (int y = 0; y < set.height(); ++y) {
    for (int x = 0; x < set.width(); ++x) {
      if (set(x, y) == 0) continue;
      for (int row = std::max(0, y - reach); row <= std::min(set.height() - 1, y + reach); ++row) {
        const int half_width = half_widths[static_cast<size_t>(std::abs(row - y))];
        const int first = std::max(0, x - half_width);
        const int last = std::min(set.width() - 1, x + half_width);
        std::fill_n(&dilated(first, row), last - first + 1, uint8_t{1});
      }
    }
  }
  return dilated;
}

uint64_t CountTrue(const PixelSet& set) {
  return static_cast<uint64_t>(std::count(set.data().begin(), set.data().end(), 1));
}

uint64_t CountCommon(const PixelSet& a, const PixelSet& b) {
  uint64_t num_common = 0;
  for (size_t i = 0; i < a.size(); ++i) num_common += a.data()[i] & b.data()[i];
  return num_common;
}

BoundaryCounts CountBoundary(const StaticMask& predicted,
                             const StaticMask& truth,
                             double tolerance_px) {
  const PixelSet predicted_outline = Outline(predicted);
  const PixelSet true_outline = Outline(truth);
  return {
      .num_predicted = CountTrue(predicted_outline),
      .num_predicted_matched = CountCommon(predicted_outline, Dilate(true_outline, tolerance_px)),
      .num_true = CountTrue(true_outline),
      .num_true_matched = CountCommon(true_outline, Dilate(predicted_outline, tolerance_px))};
}

FeatureCounts CountFeatures(const StaticMask& predicted,
                            const StaticMask& truth,
                            const std::vector<Eigen::Vector2d>& features) {
  FeatureCounts counts;
  for (const Eigen::Vector2d& feature : features) {
    const bool is_kept = !IsExcluded(predicted, feature.x(), feature.y());
    const bool is_static = !IsExcluded(truth, feature.x(), feature.y());
    counts.num_kept += is_kept;
    counts.num_kept_on_distractors += is_kept && !is_static;
    counts.num_static += is_static;
    counts.num_static_lost += is_static && !is_kept;
  }
  return counts;
}

}  // namespace

double PixelCounts::Accuracy() const {
  const uint64_t num_right = true_positive + true_negative;
  return Ratio(num_right, num_right + false_positive + false_negative, 1.0);
}

double PixelCounts::Precision() const {
  return Ratio(true_positive, true_positive + false_positive, false_negative == 0 ? 1.0 : 0.0);
}

double PixelCounts::Recall() const {
  return Ratio(true_positive, true_positive + false_negative, false_positive == 0 ? 1.0 : 0.0);
}

double PixelCounts::IoU() const {
  return Ratio(true_positive, true_positive + false_positive + false_negative, 1.0);
}

double PixelCounts::Dice() const {
  return Ratio(2 * true_positive, 2 * true_positive + false_positive + false_negative, 1.0);
}

double BoundaryCounts::Precision() const {
  return Ratio(num_predicted_matched, num_predicted, num_true == 0 ? 1.0 : 0.0);
}

double BoundaryCounts::Recall() const {
  return Ratio(num_true_matched, num_true, num_predicted == 0 ? 1.0 : 0.0);
}

double BoundaryCounts::F() const {
  const double sum = Precision() + Recall();
  return sum == 0.0 ? 0.0 : 2.0 * Precision() * Recall() / sum;
}

double FeatureCounts::OnDistractorsPer1000Kept() const {
  return Per1000(num_kept_on_distractors, num_kept);
}

double FeatureCounts::LostPer1000Static() const { return Per1000(num_static_lost, num_static); }

MaskScore& MaskScore::operator+=(const MaskScore& other) {
  pixels.true_positive += other.pixels.true_positive;
  pixels.false_positive += other.pixels.false_positive;
  pixels.false_negative += other.pixels.false_negative;
  pixels.true_negative += other.pixels.true_negative;
  boundary.num_predicted += other.boundary.num_predicted;
  boundary.num_predicted_matched += other.boundary.num_predicted_matched;
  boundary.num_true += other.boundary.num_true;
  boundary.num_true_matched += other.boundary.num_true_matched;
  features.num_kept += other.features.num_kept;
  features.num_kept_on_distractors += other.features.num_kept_on_distractors;
  features.num_static += other.features.num_static;
  features.num_static_lost += other.features.num_static_lost;
  return *this;
}

double DefaultBoundaryTolerancePx(int width, int height) {
  return std::ceil(0.008 * std::hypot(width, height));
}

MaskScore ScoreMask(const StaticMask& predicted,
                    const StaticMask& truth,
                    double tolerance_px,
                    const std::vector<Eigen::Vector2d>& features) {
  VGTW_CHECK(predicted.width() == truth.width() && predicted.height() == truth.height(),
             "the masks have one size");
  VGTW_CHECK(tolerance_px >= 0.0, "tolerance_px = " + std::to_string(tolerance_px));
  return {CountPixels(predicted, truth),
          CountBoundary(predicted, truth, tolerance_px),
          CountFeatures(predicted, truth, features)};
}

MaskRatios RatiosOf(const MaskScore& score) {
  return {.accuracy = score.pixels.Accuracy(),
          .precision = score.pixels.Precision(),
          .recall = score.pixels.Recall(),
          .f1 = score.pixels.Dice(),
          .iou = score.pixels.IoU(),
          .dice = score.pixels.Dice(),
          .boundary_f = score.boundary.F(),
          .on_distractors_per_1000_kept = score.features.OnDistractorsPer1000Kept(),
          .lost_per_1000_static = score.features.LostPer1000Static()};
}

MaskRatios MeanRatios(const std::vector<MaskScore>& scores) {
  VGTW_CHECK(!scores.empty(), "there are scores");
  constexpr double MaskRatios::*kRatios[] = {&MaskRatios::accuracy,
                                             &MaskRatios::precision,
                                             &MaskRatios::recall,
                                             &MaskRatios::f1,
                                             &MaskRatios::iou,
                                             &MaskRatios::dice,
                                             &MaskRatios::boundary_f,
                                             &MaskRatios::on_distractors_per_1000_kept,
                                             &MaskRatios::lost_per_1000_static};
  MaskRatios mean;
  for (const MaskScore& score : scores) {
    const MaskRatios ratios = RatiosOf(score);
    for (const auto ratio : kRatios) {
      mean.*ratio += ratios.*ratio / static_cast<double>(scores.size());
    }
  }
  return mean;
}

}  // namespace vgtw
