// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/config.h"
#include "network/layers.h"

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Where the pixels of a map of h x w lie in an image of `aspect` = width / height whose half
// diagonal is 1: [h, w, 2], x then y.
at::Tensor PositionGrid(int64_t height, int64_t width, double aspect);

// Sines and cosines [1, C, h, w] of the positions of a map of an image `aspect` = width / height,
// times 0.1; half the channels for x, half for y.
at::Tensor PositionMap(int64_t num_channels, int64_t height, int64_t width, double aspect);

struct DptHeadConfig {
  int64_t token_dim = 2048;
  int64_t num_outputs = 2;
  DptConfig dpt;
  bool adds_positions = true;  // the released distractor head was trained without
};

// conv2(relu(conv1(relu(x)))) + relu(x): the official skip adds the activated input, because its
// first ReLU works in place.
class ResidualUnit {
 public:
  ResidualUnit(const ParameterScope& scope, int64_t num_features);
  at::Tensor operator()(const at::Tensor& x) const;

 private:
  Convolution conv1_;
  Convolution conv2_;
};

// Takes in one more layer and doubles the resolution, or what else `height` and `width` say.
class FusionBlock {
 public:
  FusionBlock(const ParameterScope& scope, int64_t num_features, bool has_side);
  // `side` is undefined for the deepest block, which has none.
  at::Tensor operator()(const at::Tensor& x,
                        const at::Tensor& side,
                        int64_t height,
                        int64_t width) const;

 private:
  std::optional<ResidualUnit> side_unit_;
  ResidualUnit unit_;
  Convolution out_conv_;
};

// Dense prediction transformer: tokens of four layers to one map per view.
class DptHead {
 public:
  DptHead(const ParameterScope& scope, const DptHeadConfig& config);

  // layers: four times [S, 5 + P, token_dim] -> [S, num_outputs, height, width], float32, without
  // activation; height and width in pixels, multiples of the patch size.
  at::Tensor operator()(const std::array<at::Tensor, 4>& layers,
                        int64_t height,
                        int64_t width) const;

 private:
  at::Tensor Reassemble(size_t k, const at::Tensor& tokens, int64_t rows, int64_t columns) const;

  DptHeadConfig config_;
  LayerNorm norm_;
  std::vector<Convolution> projects_;
  std::vector<Upsampling> upsamplings_;
  Convolution downsampling_;
  std::vector<Convolution> to_features_;
  std::vector<FusionBlock> fusions_;  // shallowest first
  Convolution output1_;
  Convolution output2_;
  Convolution output3_;
};

}  // namespace vgtw
