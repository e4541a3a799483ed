// SPDX-License-Identifier: BSD-3-Clause
#include "network/rotary_embedding.h"

#include "scene/error.h"

#include <string>
#include <vector>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kBase = 100.0;

// Angles [T, D] of one axis, D = head_dim / 2.
at::Tensor Angles(const at::Tensor& positions, int64_t num_channels) {
  const at::Tensor exponents = at::arange(0, num_channels, 2, at::kFloat) / double(num_channels);
  const at::Tensor frequencies = 1.0 / at::pow(kBase, exponents);
  const at::Tensor angles = positions.to(at::kFloat).unsqueeze(1) * frequencies;
  return at::cat({angles, angles}, 1);
}

}  // namespace

at::Tensor TokenPositions(int64_t num_special, int64_t num_rows, int64_t num_columns) {
  const at::Tensor rows = at::arange(1, num_rows + 1).repeat_interleave(num_columns);
  const at::Tensor columns = at::arange(1, num_columns + 1).repeat({num_rows});
  return at::cat({at::zeros({num_special, 2}, at::kLong), at::stack({rows, columns}, 1)}, 0);
}

RotaryTable MakeRotaryTable(int64_t num_special,
                            int64_t num_rows,
                            int64_t num_columns,
                            int64_t head_dim,
                            const at::Device& device) {
  VGTW_CHECK(head_dim % 4 == 0, "head_dim = " + std::to_string(head_dim));
  const at::Tensor positions = TokenPositions(num_special, num_rows, num_columns);
  const at::Tensor angles = at::cat(
      {Angles(positions.select(1, 0), head_dim / 2), Angles(positions.select(1, 1), head_dim / 2)},
      1);
  return {angles.cos().to(device), angles.sin().to(device)};
}

at::Tensor Rotate(const at::Tensor& x, const RotaryTable& table) {
  const int64_t num_tokens = table.cosine.size(0);
  const int64_t head_dim = table.cosine.size(1);
  VGTW_CHECK(x.size(2) % num_tokens == 0 && x.size(3) == head_dim, "shape to rotate");
  // [B, heads, S, T, axis, half of the axis' channels, pair]
  const at::Tensor views = x.reshape({x.size(0), x.size(1), -1, num_tokens, 2, 2, head_dim / 4});
  const at::Tensor turned = at::stack({-views.select(5, 1), views.select(5, 0)}, 5);
  const std::vector<int64_t> table_shape = {num_tokens, 2, 2, head_dim / 4};
  const at::Tensor rotated =
      views * table.cosine.view(table_shape) + turned * table.sine.view(table_shape);
  return rotated.reshape(x.sizes());
}

}  // namespace vgtw
