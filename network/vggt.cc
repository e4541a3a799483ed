// SPDX-License-Identifier: BSD-3-Clause
#include "network/vggt.h"

#include "network/camera_geometry.h"

#include <algorithm>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr int64_t kFusionChannels = 128;

DptHeadConfig HeadOf(const VggtConfig& config, int64_t num_outputs) {
  return {.token_dim = 2 * config.dim, .num_outputs = num_outputs, .dpt = config.dpt};
}

// In mixed precision VGGT's heads stay in float32; VGTW's were released without that exception.
ParameterScope HeadScope(const ParameterScope& scope, const VggtConfig& config) {
  return config.lora ? scope : scope.InFloat();
}

DptHead MakeDistractorHead(const ParameterScope& scope, const VggtConfig& config) {
  DptHeadConfig head = HeadOf(config, 1);
  head.adds_positions = false;
  // Part of the state dict, never used.
  scope["fusion_conv"].Get("weight", {kFusionChannels, config.dpt.num_features / 2, 1, 1});
  scope["fusion_conv"].Get("bias", {kFusionChannels});
  return {scope, head};
}

// sign(y) (exp|y| - 1): undoes the logarithm that points were trained in.
at::Tensor InverseLog(const at::Tensor& y) { return y.sign() * at::expm1(y.abs()); }

}  // namespace

Vggt::Vggt(const ParameterScope& scope, const VggtConfig& config)
    : config_(config),
      aggregator_(scope["aggregator"], config),
      camera_head_(HeadScope(scope, config)["camera_head"], config),
      depth_head_(HeadScope(scope, config)["depth_head"], HeadOf(config, 2)) {
  if (config.has_point_head) {
    point_head_.emplace(HeadScope(scope, config)["point_head"], HeadOf(config, 4));
  }
  if (!config.has_distractor_head) return;
  distractor_head_.emplace(MakeDistractorHead(scope["mask_head"], config));
}

Features Vggt::Encode(const at::Tensor& images, const EncodeOptions& options) const {
  Features features;
  features.height = images.size(2);
  features.width = images.size(3);
  const auto keep = [&](int64_t layer, const at::Tensor& tokens) {
    for (size_t k = 0; k < config_.head_layers.size(); ++k) {
      if (config_.head_layers[k] == layer) features.layers[k] = tokens;
    }
    if (layer == config_.depth - 1) features.last = tokens;
    if (options.on_layer) options.on_layer(layer, tokens);
  };
  aggregator_(images, keep, options);
  return features;
}

CameraOutputs Vggt::PredictCameras(const Features& features) const {
  const std::vector<at::Tensor> steps = camera_head_(features.last);
  const CameraMatrices cameras = DecodePoses(steps.back(), features.height, features.width);
  return {at::stack(steps), cameras.cam_from_world, cameras.intrinsics};
}

DenseOutputs Vggt::PredictMaps(const Features& features,
                               int64_t begin,
                               int64_t end,
                               const MapChoice& choice) const {
  const std::array<at::Tensor, 4> layers = SliceViews(features, begin, end);
  const auto run = [&](const DptHead& head) {
    return head(layers, features.height, features.width);
  };
  DenseOutputs outputs;
  if (choice.depth) {
    const at::Tensor depth = run(depth_head_);
    outputs.depth = depth.select(1, 0).exp();
    outputs.depth_conf = 1.0 + depth.select(1, 1).exp();
  }
  if (choice.points && point_head_) {
    const at::Tensor points = run(*point_head_);
    outputs.points = InverseLog(points.slice(1, 0, 3)).permute({0, 2, 3, 1});
    outputs.points_conf = 1.0 + points.select(1, 3).exp();
  }
  if (distractor_head_ && choice.distractor)
    outputs.distractor_logits = run(*distractor_head_).select(1, 0);
  return outputs;
}

const TransformerBlock& Vggt::GlobalBlock(int64_t layer) const {
  return aggregator_.global_block(layer);
}

}  // namespace vgtw
