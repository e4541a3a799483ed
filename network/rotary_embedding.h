// SPDX-License-Identifier: BSD-3-Clause
// Rotary position embedding in two dimensions. Internal to network/: needs LibTorch.
#pragma once

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Cosines and sines [T, head_dim] of the T tokens of one view. The first half of the channels turns
// with the row, the second with the column; within a half of D channels, channel k and k + D/2 form
// a pair (not k and k + 1) with the frequency 100^(-2k/D).
struct RotaryTable {
  at::Tensor cosine;
  at::Tensor sine;
};

// Rows and columns [T, 2] of a view's tokens: `num_special` ones at (0, 0), then the patches row by
// row, the first at (1, 1).
at::Tensor TokenPositions(int64_t num_special, int64_t num_rows, int64_t num_columns);

RotaryTable MakeRotaryTable(int64_t num_special,
                            int64_t num_rows,
                            int64_t num_columns,
                            int64_t head_dim,
                            const at::Device& device);

// x [B, heads, S * T, head_dim], views one after the other; at least in float32.
at::Tensor Rotate(const at::Tensor& x, const RotaryTable& table);

}  // namespace vgtw
