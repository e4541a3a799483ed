// SPDX-License-Identifier: BSD-3-Clause
// Gradients of losses, by the losses themselves and by differences.
#pragma once

#include <functional>

#include <ATen/core/Tensor.h>

namespace vgtw {

using LossFunction = std::function<at::Tensor(const at::Tensor& x)>;

// The loss's own.
at::Tensor GradientOf(const LossFunction& loss, const at::Tensor& x);

// The largest difference between the loss's own gradient and central differences of step 1e-6, over
// the largest derivative. x in double; rounding then gives about 1e-9.
double GradientError(const LossFunction& loss, const at::Tensor& x);

}  // namespace vgtw
