// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/config.h"
#include "network/layers.h"

#include <cstdint>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Refines the cameras of all views in four steps from their camera tokens.
class CameraHead {
 public:
  CameraHead(const ParameterScope& scope, const VggtConfig& config);

  // tokens [S, 5 + P, 2 E] of the last layer -> pose encodings [S, 9] after each step (see
  // pose_encoding.h); the last is the prediction, training uses all.
  std::vector<at::Tensor> operator()(const at::Tensor& tokens) const;

 private:
  LayerNorm token_norm_;
  LayerNorm trunk_norm_;
  at::Tensor empty_pose_;
  Linear embed_pose_;
  Linear modulation_;
  std::vector<TransformerBlock> trunk_;
  Linear fc1_;
  Linear fc2_;
};

}  // namespace vgtw
