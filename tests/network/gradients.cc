// SPDX-License-Identifier: BSD-3-Clause
#include "tests/network/gradients.h"

#include <ATen/ATen.h>
#include <torch/csrc/autograd/autograd.h>

namespace vgtw {

at::Tensor GradientOf(const LossFunction& loss, const at::Tensor& x) {
  const at::Tensor leaf = x.detach().clone().requires_grad_();
  return torch::autograd::grad({loss(leaf)}, {leaf})[0];
}

double GradientError(const LossFunction& loss, const at::Tensor& x) {
  constexpr double kStep = 1e-6;
  const at::NoGradGuard no_gradient;
  const at::Tensor moved = x.detach().clone().contiguous();
  const at::Tensor differences = at::empty_like(moved);
  for (int64_t k = 0; k < moved.numel(); ++k) {
    double& value = moved.data_ptr<double>()[k];
    const double original = value;
    value = original + kStep;
    const double above = loss(moved).item<double>();
    value = original - kStep;
    const double below = loss(moved).item<double>();
    value = original;
    differences.data_ptr<double>()[k] = (above - below) / (2.0 * kStep);
  }
  const at::AutoGradMode with_gradients(true);
  const at::Tensor error = GradientOf(loss, x) - differences;
  return (error.abs().max() / differences.abs().max()).item<double>();
}

}  // namespace vgtw
