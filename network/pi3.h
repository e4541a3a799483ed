// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/config.h"
#include "network/dpt_head.h"
#include "network/layers.h"
#include "network/model.h"
#include "network/vision_transformer.h"

#include <functional>
#include <optional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// A few blocks within each view, with positions, from the trunk's tokens to those of one head.
class Pi3Decoder {
 public:
  Pi3Decoder(const ParameterScope& scope, const Pi3Config& config, int64_t num_outputs);
  // [n, 5 + P, 2 E] -> [n, 5 + P, num_outputs]
  at::Tensor operator()(const at::Tensor& tokens, const RotaryTable& rotary) const;

 private:
  Linear projects_;
  std::vector<TransformerBlock> blocks_;
  Linear linear_out_;
};

// One pose per view from its tokens.
class Pi3CameraHead {
 public:
  Pi3CameraHead(const ParameterScope& scope, const Pi3Config& config);
  // [n, P, camera_dim] -> world_from_cam [n, 4, 4]
  at::Tensor operator()(const at::Tensor& patch_tokens) const;

 private:
  std::vector<std::vector<Linear>> residual_units_;
  std::vector<Linear> mlps_;
  Linear translation_;
  Linear rotation_;
};

// pi3: no reference view, points in the frame of their camera; VGTW(pi3) where the configuration
// has a LoRA and a distractor head.
class Pi3 : public Model {
 public:
  Pi3(const ParameterScope& scope, const Pi3Config& config);

  Features Encode(const at::Tensor& images, const EncodeOptions& options) const override;
  CameraOutputs PredictCameras(const Features& features) const override;
  DenseOutputs PredictMaps(const Features& features,
                           int64_t begin,
                           int64_t end,
                           const MapChoice& choice) const override;
  const TransformerBlock& GlobalBlock(int64_t layer) const override;

  // What lies between, for tests: patches [S, P, E] of the encoder, tokens of the camera decoder.
  at::Tensor EncodePatches(const at::Tensor& images,
                           const std::function<void()>& on_block = {}) const;
  at::Tensor DecodeCameraTokens(const Features& features) const;

 private:
  RotaryTable RotaryOf(const Features& features, int64_t head_dim) const;

  Pi3Config config_;
  at::Tensor image_mean_;
  at::Tensor image_deviation_;
  VisionTransformer encoder_;
  at::Tensor registers_;
  std::vector<TransformerBlock> decoder_;
  Pi3Decoder point_decoder_;
  Pi3Decoder conf_decoder_;
  Pi3Decoder camera_decoder_;
  Linear point_head_;
  Linear conf_head_;
  Pi3CameraHead camera_head_;
  std::optional<DptHead> distractor_head_;
};

}  // namespace vgtw
