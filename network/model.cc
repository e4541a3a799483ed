// SPDX-License-Identifier: BSD-3-Clause
#include "network/model.h"

namespace vgtw {

std::array<at::Tensor, 4> SliceViews(const Features& features, int64_t begin, int64_t end) {
  std::array<at::Tensor, 4> slices;
  for (size_t k = 0; k < slices.size(); ++k) slices[k] = features.layers[k].slice(0, begin, end);
  return slices;
}

}  // namespace vgtw
