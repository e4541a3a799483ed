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

Aggregator::Aggregator(const ParameterScope& scope, const VggtConfig& config)
    : head_dim_(config.dim / config.num_heads),
      camera_token_(scope.Get("camera_token", {1, 2, 1, config.dim})),
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

at::Tensor Aggregator::Embed(const at::Tensor& images) const {
  const ChannelStatistics statistics = ImageNetStatistics(images.device());
  const at::Tensor normalised = (images - statistics.mean) / statistics.deviation;
  const at::Tensor patches = encoder_ ? (*encoder_)(normalised) : (*patch_embedding_)(normalised);
  const int64_t num_views = images.size(0);
  return at::cat({ForFirstAndOthers(camera_token_, num_views),
                  ForFirstAndOthers(registers_, num_views),
                  AtLeastFloat(patches)},
                 1);
}

at::Tensor Aggregator::GlobalAttentionOf(int64_t view,
                                         int64_t token,
                                         int64_t layer,
                                         const at::Tensor& tokens,
                                         int64_t height,
                                         int64_t width) const {
  const at::Tensor frame = GlobalInputOf(tokens);
  const RotaryTable rotary = MakeRotaryTable(
      kNumSpecialTokens, height / kPatchSize, width / kPatchSize, head_dim_, frame.device());
  return global_blocks_.at(static_cast<size_t>(layer))
      .AttentionWeightsOf(view * tokens.size(1) + token, frame, &rotary)
      .view({tokens.size(0), tokens.size(1)});
}

void Aggregator::operator()(const at::Tensor& images,
                            const OnLayer& on_layer,
                            const at::Tensor& excluded_patches) const {
  at::Tensor tokens = Embed(images);  // [S, T, E]
  const RotaryTable rotary = MakeRotaryTable(kNumSpecialTokens,
                                             images.size(2) / kPatchSize,
                                             images.size(3) / kPatchSize,
                                             head_dim_,
                                             images.device());
  const at::Tensor excluded = ExcludedTokens(excluded_patches);
  const at::Tensor excluded_anywhere = excluded.defined() ? excluded.view({1, -1}) : excluded;
  const int64_t dim = tokens.size(2);
  for (size_t i = 0; i < frame_blocks_.size(); ++i) {
    const at::Tensor frame = frame_blocks_[i](tokens, &rotary, excluded);
    tokens =
        global_blocks_[i](frame.view({1, -1, dim}), &rotary, excluded_anywhere).view(frame.sizes());
    on_layer(static_cast<int64_t>(i), at::cat({frame, tokens}, 2));
  }
}

}  // namespace vgtw
