// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/config.h"
#include "network/layers.h"

#include <cstdint>
#include <functional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Mean and deviation [1, 3, 1, 1] of ImageNet's channels.
struct ChannelStatistics {
  at::Tensor mean;
  at::Tensor deviation;
};
ChannelStatistics ImageNetStatistics(const at::Device& device);
// images [S, 3, H, W] in [0, 1] by these.
at::Tensor NormaliseImages(const at::Tensor& images);

// Position embeddings [1, 1 + P, E] for num_rows x num_columns patches from those of a square grid
// [1, 1 + grid^2, E], of which the first is the class token's: bicubic and antialiased, in float32.
at::Tensor ResizePositions(const at::Tensor& positions, int64_t num_rows, int64_t num_columns);

// One vector per patch of 14 x 14 pixels: [S, 3, H, W] -> [S, P, E], row by row.
class PatchEmbedding {
 public:
  PatchEmbedding(const ParameterScope& scope, int64_t dim);
  at::Tensor operator()(const at::Tensor& images) const;

 private:
  Convolution projection_;
};

// DINOv2 with register tokens.
class VisionTransformer {
 public:
  VisionTransformer(const ParameterScope& scope, const EncoderConfig& config);
  // Tokens [S, 5 + P, E] after the last block, not yet normalised: class, registers, patches.
  at::Tensor EncodeWithoutNorm(const at::Tensor& normalised_images,
                               const std::function<void()>& on_block = {}) const;
  // Patch tokens [S, P, E].
  at::Tensor operator()(const at::Tensor& normalised_images,
                        const std::function<void()>& on_block = {}) const;

 private:
  PatchEmbedding patch_embedding_;
  at::Tensor class_token_;
  at::Tensor positions_;
  at::Tensor registers_;
  std::vector<TransformerBlock> blocks_;
  LayerNorm norm_;
};

}  // namespace vgtw
