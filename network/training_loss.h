// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/model.h"
#include "network/train.h"
#include "network/training_sample.h"

#include <array>

#include <ATen/core/Tensor.h>

namespace vgtw {

struct SampleLoss {
  at::Tensor total;                                    // scalar, weighted
  std::array<double, kNumTrainingLosses> values = {};  // not weighted; 0 where the weight is
};

// [S, P, C] of one of the four layers that dense heads read; 3 = the last of all, which every model
// has.
at::Tensor PatchFeatures(const Features& features, int layer);

// Of one sample on the model's device. Only what has a weight is computed, and what a sample knows
// nothing of is 0. `feature_layer` as in TrainOptions.
SampleLoss ComputeSampleLoss(const Model& model,
                             const TrainingSample& sample,
                             const std::array<double, kNumTrainingLosses>& weights,
                             int feature_layer);

}  // namespace vgtw
