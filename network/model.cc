// SPDX-License-Identifier: BSD-3-Clause
#include "network/model.h"

#include "network/config.h"

#include <ATen/ATen.h>

namespace vgtw {

std::array<at::Tensor, 4> SliceViews(const Features& features, int64_t begin, int64_t end) {
  std::array<at::Tensor, 4> slices;
  for (size_t k = 0; k < slices.size(); ++k) slices[k] = features.layers[k].slice(0, begin, end);
  return slices;
}

at::Tensor ExcludedTokens(const at::Tensor& excluded_patches) {
  if (!excluded_patches.defined()) return {};
  return at::cat(
      {at::zeros({excluded_patches.size(0), kNumSpecialTokens}, excluded_patches.options()),
       excluded_patches},
      1);
}

at::Tensor GlobalInputOf(const at::Tensor& tokens) {
  return tokens.slice(2, 0, tokens.size(2) / 2).reshape({1, -1, tokens.size(2) / 2});
}

}  // namespace vgtw
