// SPDX-License-Identifier: BSD-3-Clause
// What a network does otherwise while it is trained. Internal to network/: needs LibTorch.
#pragma once

#include <cstdint>
#include <functional>

#include <ATen/core/Tensor.h>

namespace vgtw {

struct TrainingMode {
  // Share of the inputs of a LoRA that are set to zero, the others scaled up for it.
  double lora_dropout = 0.0;
  uint64_t dropout_seed = 0;
  // Keeps of a transformer block its input alone and runs it again for the gradient: a third more
  // time, a small part of the memory. Gradients of parameters then exist by backward() only.
  bool recompute_blocks = false;
  uint64_t num_dropouts = 0;  // so far
};

// The mode of this thread while the object lives; without one, networks predict.
class TrainingModeScope {
 public:
  explicit TrainingModeScope(const TrainingMode& mode);
  ~TrainingModeScope();
  TrainingModeScope(const TrainingModeScope&) = delete;
  TrainingModeScope& operator=(const TrainingModeScope&) = delete;

 private:
  TrainingMode mode_;
  TrainingMode* previous_;
};

// x, in a mode with dropout with some elements dropped: which ones is a function of the seed and of
// how often this was called before.
at::Tensor DropLoraInputs(const at::Tensor& x);

// block(x), in a mode that recomputes blocks such that this one is. What `block` refers to must
// outlive the backward pass.
using BlockFunction = std::function<at::Tensor(const at::Tensor& x)>;
at::Tensor RunBlock(BlockFunction block, const at::Tensor& x);

}  // namespace vgtw
