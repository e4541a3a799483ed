// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// How many pixels two masks share. Positive = distractor, that is excluded.
struct PixelCounts {
  uint64_t true_positive = 0;
  uint64_t false_positive = 0;  // static, but excluded by the prediction
  uint64_t false_negative = 0;  // distractor, but kept by the prediction
  uint64_t true_negative = 0;

  // Ratios in [0,1]. One whose denominator is 0 is 1 if neither mask has a distractor (nothing to
  // find, nothing found) and 0 if one of them has.
  double Accuracy() const;   // (TP + TN) / all
  double Precision() const;  // TP / (TP + FP)
  double Recall() const;     // TP / (TP + FN)
  double IoU() const;        // TP / (TP + FP + FN)
  double Dice() const;       // 2 TP / (2 TP + FP + FN); for binary masks the same number as F1
};

// Pixels of the distractors' outlines and those that the other mask's outline has, too, within the
// tolerance.
struct BoundaryCounts {
  uint64_t num_predicted = 0;
  uint64_t num_predicted_matched = 0;
  uint64_t num_true = 0;
  uint64_t num_true_matched = 0;

  // As above: 1 where neither mask has an outline, 0 where one of them has.
  double Precision() const;
  double Recall() const;
  double F() const;  // 2 P R / (P + R), 0 if both are 0
};

// What masks mean to structure-from-motion, by the features that were found without any.
struct FeatureCounts {
  uint64_t num_kept = 0;                 // by the prediction
  uint64_t num_kept_on_distractors = 0;  // of these, on true distractors
  uint64_t num_static = 0;               // by the truth
  uint64_t num_static_lost = 0;          // of these, excluded by the prediction

  double OnDistractorsPer1000Kept() const;  // 0 if none is kept
  double LostPer1000Static() const;         // 0 if none is static
};

struct MaskScore {
  PixelCounts pixels;
  BoundaryCounts boundary;
  FeatureCounts features;

  MaskScore& operator+=(const MaskScore& other);  // pools the counts
};

// 0.008 of the image's diagonal, rounded up: the tolerance of the DAVIS benchmark (Perazzi et al.,
// "A Benchmark Dataset and Evaluation Methodology for Video Object Segmentation", 2016).
double DefaultBoundaryTolerancePx(int width, int height);

// `predicted` against `truth`. As in DAVIS an outline is the pixels that differ from their
// neighbour to the right, below, or between these two, so that the image's border is none; a pixel
// of one outline is matched if one of the other lies within `tolerance_px` (>= 0) of it.
// `features`: COLMAP pixels of the unmasked features; see IsExcluded.
// Throws std::invalid_argument if the sizes of the masks disagree.
MaskScore ScoreMask(const StaticMask& predicted,
                    const StaticMask& truth,
                    double tolerance_px,
                    const std::vector<Eigen::Vector2d>& features = {});

// The ratios of one mask, or their means over masks.
struct MaskRatios {
  double accuracy = 0.0;
  double precision = 0.0;
  double recall = 0.0;
  double f1 = 0.0;
  double iou = 0.0;
  double dice = 0.0;
  double boundary_f = 0.0;
  double on_distractors_per_1000_kept = 0.0;  // features
  double lost_per_1000_static = 0.0;
};
MaskRatios RatiosOf(const MaskScore& score);

// Mean of every ratio over the images, each with the same weight. This is how the paper averages:
// its F1 (0.5896) is not that of its precision and recall (0.6304, 0.5738: 0.6008), as pooled
// counts would have it. Throws std::invalid_argument without scores.
MaskRatios MeanRatios(const std::vector<MaskScore>& scores);

}  // namespace vgtw
