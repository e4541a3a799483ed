// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/model.h"
#include "network/train.h"
#include "network/training_sample.h"

#include <cstdint>
#include <vector>

namespace vgtw {

// What one sample adds to a ValidationScore.
struct SampleScore {
  // Pixels of masks at probability 0.5.
  int64_t true_positives = 0;
  int64_t false_positives = 0;
  int64_t false_negatives = 0;
  // Of known depths of static pixels, scaled by the ratio of the medians over all views together.
  double sum_relative_errors = 0.0;
  int64_t num_within_1_25 = 0;
  int64_t num_depths = 0;
  // Of pairs of views: errors of the relative rotation and of the direction of the baseline, whose
  // sign counts.
  std::vector<double> rotations_deg;
  std::vector<double> directions_deg;
  // Confidence of depths, where both a distractor and something static are seen; else 0.
  double confidence_on_distractors = 0.0;
  double confidence_on_static = 0.0;
  double patch_similarity = 0.0;  // mean over any two static patches; 0 without
  // Patches whose place another view shows, once for each such view, and those of them whose most
  // similar patch there is one of the four around that place.
  int64_t num_matched_patches = 0;
  int64_t num_nearest_right = 0;
};

// With a distractor head or without. `feature_layer` as in TrainOptions.
SampleScore ScoreSample(const Model& model, const TrainingSample& sample, int feature_layer);

ValidationScore Summarise(const std::vector<SampleScore>& samples, int64_t step);

}  // namespace vgtw
