// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/config.h"
#include "network/layers.h"
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
  // images [S, 3, H, W] in [0, 1]. `excluded_patches` [S, P] or undefined: true = no token of the
  // frame and global blocks attends to this patch.
  void operator()(const at::Tensor& images,
                  const OnLayer& on_layer,
                  const at::Tensor& excluded_patches = {}) const;

  // See Model::GlobalAttentionOf.
  at::Tensor GlobalAttentionOf(int64_t view,
                               int64_t token,
                               int64_t layer,
                               const at::Tensor& tokens,
                               int64_t height,
                               int64_t width) const;

  const std::optional<VisionTransformer>& encoder() const { return encoder_; }

 private:
  at::Tensor Embed(const at::Tensor& images) const;

  int64_t head_dim_;
  std::optional<VisionTransformer> encoder_;
  std::optional<PatchEmbedding> patch_embedding_;
  at::Tensor camera_token_;
  at::Tensor registers_;
  std::vector<TransformerBlock> frame_blocks_;
  std::vector<TransformerBlock> global_blocks_;
};

// What the global block of a layer read, [1, S * T, E]: the first half of its tokens [S, T, 2 E].
at::Tensor GlobalInputOf(const at::Tensor& tokens);

// Which tokens of [S, 5 + P] to leave out of attention, from patches [S, P]; undefined stays so.
at::Tensor ExcludedTokens(const at::Tensor& excluded_patches);

}  // namespace vgtw
