// SPDX-License-Identifier: BSD-3-Clause
#include "network/vision_transformer.h"

#include "scene/error.h"

#include <cmath>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kNormEps = 1e-6;  // others in the networks are 1e-5
constexpr int64_t kNumRegisters = kNumSpecialTokens - 1;

int64_t NumPositions(const EncoderConfig& config) {
  return 1 + config.grid_size * config.grid_size;
}

at::Tensor ForEachView(const at::Tensor& token, int64_t num_views) {
  return token.expand({num_views, -1, -1});
}

}  // namespace

ChannelStatistics ImageNetStatistics(const at::Device& device) {
  const auto per_channel = [&](at::ArrayRef<float> values) {
    return at::tensor(values).view({1, 3, 1, 1}).to(device);
  };
  return {per_channel({0.485f, 0.456f, 0.406f}), per_channel({0.229f, 0.224f, 0.225f})};
}

at::Tensor NormaliseImages(const at::Tensor& images) {
  const ChannelStatistics statistics = ImageNetStatistics(images.device());
  return (images - statistics.mean) / statistics.deviation;
}

at::Tensor ResizePositions(const at::Tensor& positions, int64_t num_rows, int64_t num_columns) {
  const int64_t grid_size = std::lround(std::sqrt(static_cast<double>(positions.size(1) - 1)));
  if (num_rows == grid_size && num_columns == grid_size) return positions;
  const at::Tensor grid = positions.slice(1, 1)
                              .reshape({1, grid_size, grid_size, positions.size(2)})
                              .permute({0, 3, 1, 2});
  const at::Tensor resized =
      at::_upsample_bicubic2d_aa(grid, {num_rows, num_columns}, /*align_corners=*/false, {}, {});
  return at::cat({positions.slice(1, 0, 1), resized.flatten(2).transpose(1, 2)}, 1);
}

PatchEmbedding::PatchEmbedding(const ParameterScope& scope, int64_t dim)
    : projection_(
          scope["proj"],
          {.num_inputs = 3, .num_outputs = dim, .kernel = kPatchSize, .stride = kPatchSize}) {}

at::Tensor PatchEmbedding::operator()(const at::Tensor& images) const {
  return projection_(images).flatten(2).transpose(1, 2);
}

VisionTransformer::VisionTransformer(const ParameterScope& scope, const EncoderConfig& config)
    : patch_embedding_(scope["patch_embed"], config.dim),
      class_token_(scope.Get("cls_token", {1, 1, config.dim})),
      positions_(scope.Get("pos_embed", {1, NumPositions(config), config.dim})),
      registers_(scope.Get("register_tokens", {1, kNumRegisters, config.dim})),
      norm_(scope["norm"], config.dim, kNormEps) {
  BlockConfig block;
  block.attention = {.dim = config.dim, .num_heads = config.num_heads};
  block.norm_eps = kNormEps;
  for (int64_t i = 0; i < config.depth; ++i) blocks_.emplace_back(scope["blocks"][i], block);
}

at::Tensor VisionTransformer::EncodeWithoutNorm(const at::Tensor& images,
                                                const std::function<void()>& on_block) const {
  VGTW_CHECK(images.size(2) % kPatchSize == 0 && images.size(3) % kPatchSize == 0,
             "image size in patches");
  const int64_t num_views = images.size(0);
  at::Tensor tokens =
      at::cat({ForEachView(class_token_, num_views), AtLeastFloat(patch_embedding_(images))}, 1);
  tokens = tokens +
           ResizePositions(positions_, images.size(2) / kPatchSize, images.size(3) / kPatchSize);
  // Registers have no position.
  tokens =
      at::cat({tokens.slice(1, 0, 1), ForEachView(registers_, num_views), tokens.slice(1, 1)}, 1);
  for (const TransformerBlock& block : blocks_) {
    tokens = block(tokens);
    if (on_block) on_block();
  }
  return tokens;
}

at::Tensor VisionTransformer::operator()(const at::Tensor& images,
                                         const std::function<void()>& on_block) const {
  return norm_(EncodeWithoutNorm(images, on_block)).slice(1, kNumSpecialTokens);
}

}  // namespace vgtw
