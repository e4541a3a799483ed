// SPDX-License-Identifier: BSD-3-Clause
#include "network/pi3.h"

#include "network/camera_geometry.h"

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kNormEps = 1e-6;
constexpr int64_t kDecoderDepth = 5;
constexpr int64_t kPatchPixels = kPatchSize * kPatchSize;

BlockConfig TrunkBlock(const Pi3Config& config) {
  BlockConfig block;
  block.attention = {.dim = config.encoder.dim,
                     .num_heads = config.encoder.num_heads,
                     .has_qk_norm = true,
                     .lora = config.lora};
  block.norm_eps = kNormEps;
  return block;
}

BlockConfig HeadBlock(const Pi3Config& config) {
  BlockConfig block;
  block.attention = {.dim = config.head_dim, .num_heads = config.num_head_heads};
  block.norm_eps = kNormEps;
  block.has_layer_scale = false;
  return block;
}

// One value per pixel from one vector per patch: [n, P, C * 14 * 14] -> [n, C, H, W].
at::Tensor PatchesToPixels(const at::Tensor& patches, int64_t height, int64_t width) {
  const at::Tensor grid = patches.transpose(1, 2).reshape(
      {patches.size(0), patches.size(2), height / kPatchSize, width / kPatchSize});
  return AtLeastFloat(at::pixel_shuffle(grid, kPatchSize));
}

}  // namespace

Pi3Decoder::Pi3Decoder(const ParameterScope& scope, const Pi3Config& config, int64_t num_outputs)
    : projects_(scope["projects"], 2 * config.encoder.dim, config.head_dim),
      linear_out_(scope["linear_out"], config.head_dim, num_outputs) {
  for (int64_t i = 0; i < kDecoderDepth; ++i) {
    blocks_.emplace_back(scope["blocks"][i], HeadBlock(config));
  }
}

at::Tensor Pi3Decoder::operator()(const at::Tensor& tokens, const RotaryTable& rotary) const {
  at::Tensor x = AtLeastFloat(projects_(tokens));
  for (const TransformerBlock& block : blocks_) x = block(x, &rotary);
  return linear_out_(x);
}

Pi3CameraHead::Pi3CameraHead(const ParameterScope& scope, const Pi3Config& config)
    : translation_(scope["fc_t"], config.camera_dim, 3),
      rotation_(scope["fc_rot"], config.camera_dim, 9) {
  const int64_t dim = config.camera_dim;
  for (int64_t i = 0; i < 2; ++i) {
    std::vector<Linear>& unit = residual_units_.emplace_back();
    for (const char* name : {"res_conv1", "res_conv2", "res_conv3"}) {
      unit.emplace_back(scope["res_conv"][i][name], dim, dim);
    }
  }
  for (const int64_t i : {0, 2}) mlps_.emplace_back(scope["more_mlps"][i], dim, dim);
}

at::Tensor Pi3CameraHead::operator()(const at::Tensor& patch_tokens) const {
  at::Tensor x = patch_tokens;
  for (const std::vector<Linear>& unit : residual_units_) {
    at::Tensor change = x;
    for (const Linear& linear : unit) change = linear(change).relu();
    x = x + change;
  }
  x = x.mean(1);
  for (const Linear& linear : mlps_) x = linear(x).relu();
  const at::Tensor rotations = NearestRotations(rotation_(x));
  const at::Tensor top = at::cat({rotations, translation_(x).unsqueeze(2)}, 2);
  const at::Tensor bottom = at::tensor({0.0f, 0.0f, 0.0f, 1.0f}, top.options());
  return at::cat({top, bottom.view({1, 1, 4}).expand({top.size(0), -1, -1})}, 1);
}

Pi3::Pi3(const ParameterScope& scope, const Pi3Config& config)
    : config_(config),
      image_mean_(scope.Get("image_mean", {1, 3, 1, 1})),
      image_deviation_(scope.Get("image_std", {1, 3, 1, 1})),
      encoder_(scope["encoder"], config.encoder),
      registers_(scope.Get("register_token", {1, 1, kNumSpecialTokens, config.encoder.dim})),
      point_decoder_(scope["point_decoder"], config, config.head_dim),
      conf_decoder_(scope["conf_decoder"], config, config.head_dim),
      camera_decoder_(scope["camera_decoder"], config, config.camera_dim),
      point_head_(scope.InFloat()["point_head"]["proj"], config.head_dim, 3 * kPatchPixels),
      conf_head_(scope.InFloat()["conf_head"]["proj"], config.head_dim, kPatchPixels),
      camera_head_(scope.InFloat()["camera_head"], config) {
  for (int64_t i = 0; i < config.depth; ++i) {
    decoder_.emplace_back(scope["decoder"][i], TrunkBlock(config));
  }
  if (!config.has_distractor_head) return;
  distractor_head_.emplace(scope["mask_head"],
                           DptHeadConfig{.token_dim = 2 * config.encoder.dim,
                                         .num_outputs = 1,
                                         .dpt = config.dpt,
                                         .adds_positions = false});
}

RotaryTable Pi3::RotaryOf(const Features& features, int64_t head_dim) const {
  return MakeRotaryTable(kNumSpecialTokens,
                         features.height / kPatchSize,
                         features.width / kPatchSize,
                         head_dim,
                         registers_.device());
}

at::Tensor Pi3::EncodePatches(const at::Tensor& images,
                              const std::function<void()>& on_block) const {
  return encoder_((images - image_mean_) / image_deviation_, on_block);
}

Features Pi3::Encode(const at::Tensor& images, const EncodeOptions& options) const {
  Features features;
  features.height = images.size(2);
  features.width = images.size(3);
  const int64_t num_views = images.size(0);
  const int64_t dim = config_.encoder.dim;
  at::Tensor tokens = at::cat(
      {registers_[0].expand({num_views, -1, -1}), EncodePatches(images, options.on_block)}, 1);
  const at::Tensor excluded = ExcludedTokens(options.excluded_patches);
  const at::Tensor excluded_anywhere = excluded.defined() ? excluded.view({1, -1}) : excluded;
  const RotaryTable rotary = RotaryOf(features, dim / config_.encoder.num_heads);
  for (size_t i = 0; i + 1 < decoder_.size(); i += 2) {
    const at::Tensor frame = decoder_[i](tokens, &rotary, excluded);
    if (options.on_block) options.on_block();
    tokens =
        decoder_[i + 1](frame.view({1, -1, dim}), &rotary, excluded_anywhere).view(frame.sizes());
    if (options.on_block) options.on_block();
    const auto layer = static_cast<int64_t>(i / 2);
    features.last = at::cat({frame, tokens}, 2);
    for (size_t k = 0; distractor_head_ && k < config_.head_layers.size(); ++k) {
      if (config_.head_layers[k] == layer) features.layers[k] = features.last;
    }
    if (options.on_layer) options.on_layer(layer, features.last);
  }
  return features;
}

at::Tensor Pi3::DecodeCameraTokens(const Features& features) const {
  return camera_decoder_(features.last,
                         RotaryOf(features, config_.head_dim / config_.num_head_heads));
}

CameraOutputs Pi3::PredictCameras(const Features& features) const {
  const at::Tensor tokens = DecodeCameraTokens(features).slice(1, kNumSpecialTokens);
  const at::Tensor world_from_cam = camera_head_(tokens);
  return {.cam_from_world = InvertPoses(world_from_cam.slice(1, 0, 3))};
}

DenseOutputs Pi3::PredictMaps(const Features& features,
                              int64_t begin,
                              int64_t end,
                              const MapChoice& choice) const {
  const at::Tensor tokens = features.last.slice(0, begin, end);
  const RotaryTable rotary = RotaryOf(features, config_.head_dim / config_.num_head_heads);
  const auto to_pixels = [&](const Pi3Decoder& decoder, const Linear& head) {
    const at::Tensor patches = head(decoder(tokens, rotary).slice(1, kNumSpecialTokens));
    return PatchesToPixels(patches, features.height, features.width);
  };
  DenseOutputs outputs;
  if (choice.depth) {
    const at::Tensor raw = to_pixels(point_decoder_, point_head_);  // slopes of the ray, log depth
    outputs.depth = raw.select(1, 2).exp();
    outputs.local_points = at::stack(
        {raw.select(1, 0) * outputs.depth, raw.select(1, 1) * outputs.depth, outputs.depth}, 3);
    outputs.depth_conf = to_pixels(conf_decoder_, conf_head_).select(1, 0);
  }
  if (distractor_head_ && choice.distractor) {
    outputs.distractor_logits =
        (*distractor_head_)(SliceViews(features, begin, end), features.height, features.width)
            .select(1, 0);
  }
  return outputs;
}

const TransformerBlock& Pi3::GlobalBlock(int64_t layer) const {
  return decoder_.at(static_cast<size_t>(2 * layer + 1));
}

}  // namespace vgtw
