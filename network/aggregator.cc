// SPDX-License-Identifier: BSD-3-Clause
#include "network/aggregator.h"

#include "scene/error.h"

#include <ATen/ATen.h>

namespace vgtw {
namespace {

BlockConfig BlockOf(const VggtConfig& config) {
  BlockConfig block;
  block.attention = {
      .dim = config.dim, .num_heads = config.num_heads, .has_qk_norm = true, .lora = config.lora};
  return block;
}

// [1, 2, n, E]: one set for the first view and one for all others -> [S, n, E].
at::Tensor ForFirstAndOthers(const at::Tensor& tokens, int64_t num_views) {
  return at::cat({tokens.select(1, 0), tokens.select(1, 1).expand({num_views - 1, -1, -1})}, 0);
}

}  // namespace

Aggregator::Aggregator(const ParameterScope& scope, const VggtConfig& config)
    : camera_token_(scope.Get("camera_token", {1, 2, 1, config.dim})),
      registers_(scope.Get("register_token", {1, 2, kNumSpecialTokens - 1, config.dim})) {
  const ParameterScope embedding = scope["patch_embed"];
  if (config.encoder) {
    VGTW_CHECK(config.encoder->dim == config.dim, "widths of encoder and aggregator");
    encoder_.emplace(embedding, *config.encoder);
    embedding.Get("mask_token", {1, config.dim});  // part of the state dict, never used
  } else {
    patch_embedding_.emplace(embedding, config.dim);
  }
  const BlockConfig block = BlockOf(config);
  for (int64_t i = 0; i < config.depth; ++i) {
    frame_blocks_.emplace_back(scope["frame_blocks"][i], block);
    global_blocks_.emplace_back(scope["global_blocks"][i], block);
  }
}

at::Tensor Aggregator::Embed(const at::Tensor& images,
                             const std::function<void()>& on_block) const {
  const at::Tensor normalised = NormaliseImages(images);
  const at::Tensor patches =
      encoder_ ? (*encoder_)(normalised, on_block) : (*patch_embedding_)(normalised);
  const int64_t num_views = images.size(0);
  return at::cat({ForFirstAndOthers(camera_token_, num_views),
                  ForFirstAndOthers(registers_, num_views),
                  AtLeastFloat(patches)},
                 1);
}

void Aggregator::operator()(const at::Tensor& images,
                            const OnLayer& on_layer,
                            const EncodeOptions& options) const {
  at::Tensor tokens = Embed(images, options.on_block);  // [S, T, E]
  const RotaryTable rotary = MakeRotaryTable(kNumSpecialTokens,
                                             images.size(2) / kPatchSize,
                                             images.size(3) / kPatchSize,
                                             frame_blocks_.front().head_dim(),
                                             images.device());
  const at::Tensor excluded = ExcludedTokens(options.excluded_patches);
  const at::Tensor excluded_anywhere = excluded.defined() ? excluded.view({1, -1}) : excluded;
  const int64_t dim = tokens.size(2);
  for (size_t i = 0; i < frame_blocks_.size(); ++i) {
    const at::Tensor frame = frame_blocks_[i](tokens, &rotary, excluded);
    if (options.on_block) options.on_block();
    tokens =
        global_blocks_[i](frame.view({1, -1, dim}), &rotary, excluded_anywhere).view(frame.sizes());
    if (options.on_block) options.on_block();
    on_layer(static_cast<int64_t>(i), at::cat({frame, tokens}, 2));
  }
}

}  // namespace vgtw
