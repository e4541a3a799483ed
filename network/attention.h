// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include <ATen/core/Tensor.h>

namespace vgtw {

// softmax(q k^T / sqrt(d)) v for q, k, v [B, heads, N, d] of one type, without ever holding the
// N x N matrix: some rows of queries at a time, each of whose softmax is complete; where LibTorch
// has a fused kernel, that one. `excluded_keys` [B, N] or undefined: true = weight zero; every row
// must leave at least one key.
at::Tensor Attend(const at::Tensor& q,
                  const at::Tensor& k,
                  const at::Tensor& v,
                  const at::Tensor& excluded_keys = {});

}  // namespace vgtw
