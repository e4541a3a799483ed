// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/trained_parameters.h"

#include <array>
#include <cstdint>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Linear from 1e-8 to the peak over the first share of the steps, a half cosine down to 1e-8 over
// the last share, the peak in between.
struct LearningRateSchedule {
  double peak = 1e-4;
  double warmup_share = 0.05;
  double decay_share = 0.95;
  int64_t num_steps = 1;

  double At(int64_t step) const;  // step in [0, num_steps)
};

struct AdamWOptions {
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon = 1e-8;
  double weight_decay = 0.05;   // of parameters that decay
  double max_group_norm = 1.0;  // longer gradients of a group are shortened to this; 0 = none
  double ema_decay = 0.0;       // of the mean of past values; 0 = none is kept
  // Over the learning rate of a step, by group.
  std::array<double, kNumParameterGroups> rate_factors = {1.0, 1.0, 1.0, 1.0};
};

// AdamW (Loshchilov and Hutter) with clipping by group. LibTorch's own keeps its state behind
// pointers whose type differs between versions; ours is what a resumed run reads back bit by bit.
class AdamW {
 public:
  // One entry per parameter, undefined where none is trained.
  struct Moments {
    std::vector<at::Tensor> first;
    std::vector<at::Tensor> second;
    std::vector<at::Tensor> mean;  // of values; empty without EMA
  };

  AdamW(TrainedParameters& parameters, const AdamWOptions& options);

  // Moves the parameters against `gradients` (same order; undefined = zero) and returns the norm
  // that each group had before it was clipped; if one is not finite, nothing moves. `step` counts
  // from 0.
  using GroupNorms = std::array<double, kNumParameterGroups>;
  GroupNorms Step(std::vector<at::Tensor> gradients, int64_t step, double learning_rate);

  Moments& moments() { return moments_; }
  const Moments& moments() const { return moments_; }

 private:
  GroupNorms Clip(std::vector<at::Tensor>& gradients) const;

  TrainedParameters& parameters_;
  AdamWOptions options_;
  Moments moments_;
};

bool AreFinite(const AdamW::GroupNorms& norms);

}  // namespace vgtw
