// SPDX-License-Identifier: BSD-3-Clause
#include "network/adamw.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kLowestRate = 1e-8;

}  // namespace

double LearningRateSchedule::At(int64_t step) const {
  const auto num = static_cast<double>(num_steps);
  const auto done = static_cast<double>(step);
  const double num_warmup = warmup_share * num;
  if (done < num_warmup) return kLowestRate + (peak - kLowestRate) * done / num_warmup;
  const double num_decay = decay_share * num;
  if (num_decay <= 0.0) return peak;
  const double share = std::max(0.0, 1.0 - (num - done) / num_decay);
  return kLowestRate + 0.5 * (peak - kLowestRate) * (1.0 + std::cos(std::numbers::pi * share));
}

bool AreFinite(const AdamW::GroupNorms& norms) {
  return std::all_of(norms.begin(), norms.end(), [](double norm) { return std::isfinite(norm); });
}

AdamW::AdamW(TrainedParameters& parameters, const AdamWOptions& options)
    : parameters_(parameters), options_(options) {
  for (const TrainedParameter& parameter : parameters.all()) {
    const auto zero = [&] {
      return parameter.is_trained ? at::zeros_like(parameter.value) : at::Tensor();
    };
    moments_.first.push_back(zero());
    moments_.second.push_back(zero());
    if (options.ema_decay > 0.0) {
      moments_.mean.push_back(parameter.is_trained ? parameter.value.clone() : at::Tensor());
    }
  }
}

AdamW::GroupNorms AdamW::Clip(std::vector<at::Tensor>& gradients) const {
  GroupNorms norms = {};
  for (size_t i = 0; i < gradients.size(); ++i) {
    if (!gradients[i].defined()) continue;
    const auto group = static_cast<size_t>(parameters_.all()[i].group);
    norms[group] += gradients[i].square().sum().item<double>();
  }
  for (double& norm : norms) norm = std::sqrt(norm);
  if (options_.max_group_norm <= 0.0) return norms;
  for (size_t i = 0; i < gradients.size(); ++i) {
    const double norm = norms[static_cast<size_t>(parameters_.all()[i].group)];
    if (!gradients[i].defined() || norm <= options_.max_group_norm) continue;
    gradients[i] = gradients[i] * (options_.max_group_norm / norm);
  }
  return norms;
}

AdamW::GroupNorms AdamW::Step(std::vector<at::Tensor> gradients,
                              int64_t step,
                              double learning_rate) {
  const GroupNorms norms = Clip(gradients);
  if (!AreFinite(norms)) return norms;
  const auto power = static_cast<double>(step + 1);
  const double correction1 = 1.0 - std::pow(options_.beta1, power);
  const double correction2 = 1.0 - std::pow(options_.beta2, power);
  for (size_t i = 0; i < gradients.size(); ++i) {
    TrainedParameter& parameter = parameters_.all()[i];
    if (!parameter.is_trained || !gradients[i].defined()) continue;
    const double rate = learning_rate * options_.rate_factors[static_cast<size_t>(parameter.group)];
    if (parameter.decays) parameter.value.mul_(1.0 - rate * options_.weight_decay);
    at::Tensor& first = moments_.first[i];
    at::Tensor& second = moments_.second[i];
    first.mul_(options_.beta1).add_(gradients[i], 1.0 - options_.beta1);
    second.mul_(options_.beta2).addcmul_(gradients[i], gradients[i], 1.0 - options_.beta2);
    const at::Tensor root = (second / correction2).sqrt_().add_(options_.epsilon);
    parameter.value.addcdiv_(first, root, -rate / correction1);
    if (moments_.mean.empty()) continue;
    // At first of few steps, or the fresh values would last long.
    const double decay = std::min(options_.ema_decay, power / (power + 9.0));
    moments_.mean[i].lerp_(parameter.value, 1.0 - decay);
  }
  return norms;
}

}  // namespace vgtw
