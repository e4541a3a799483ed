// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/geometry_losses.h"

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Views of one scene with what is true of them.
struct TrainingSample {
  at::Tensor images;      // [S, 3, H, W] in [0, 1]
  at::Tensor distractor;  // [S, H, W], 1 = distractor, NaN = unknown
  GeometryTruth truth;    // undefined tensors where no geometry is known
};

// Samples without end: a function of the index alone, for several threads at once.
class SampleSource {
 public:
  virtual ~SampleSource() = default;
  virtual TrainingSample Get(uint64_t idx) const = 0;
};

}  // namespace vgtw
