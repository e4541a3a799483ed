// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/config.h"
#include "network/layers.h"
#include "network/model.h"
#include "network/vision_transformer.h"

#include <functional>
#include <optional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// VGGT's trunk: blocks that look within one view alternate with blocks that look across all. The
// first view has a camera token and registers of its own, which makes its frame the reference.
class Aggregator {
 public:
  Aggregator(const ParameterScope& scope, const VggtConfig& config);

  // Gets layer i's tokens [S, 5 + P, 2 E] (frame block, then global block) as soon as they exist.
  using OnLayer = std::function<void(int64_t layer, const at::Tensor& tokens)>;
  // images [S, 3, H, W] in [0, 1].
  void operator()(const at::Tensor& images,
                  const OnLayer& on_layer,
                  const EncodeOptions& options) const;

  const TransformerBlock& global_block(int64_t layer) const {
    return global_blocks_.at(static_cast<size_t>(layer));
  }
  const std::optional<VisionTransformer>& encoder() const { return encoder_; }

 private:
  at::Tensor Embed(const at::Tensor& images, const std::function<void()>& on_block) const;

  std::optional<VisionTransformer> encoder_;
  std::optional<PatchEmbedding> patch_embedding_;
  at::Tensor camera_token_;
  at::Tensor registers_;
  std::vector<TransformerBlock> frame_blocks_;
  std::vector<TransformerBlock> global_blocks_;
};

}  // namespace vgtw
