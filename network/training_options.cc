// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_options.h"

#include "scene/error.h"

#include <cmath>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;

void CheckShare(double share, const char* name) {
  VGTW_CHECK(share >= 0.0 && share <= 1.0, name + (" = " + std::to_string(share)));
}

void CheckPositive(double value, const char* name) {
  VGTW_CHECK(value > 0.0 && std::isfinite(value), name + (" = " + std::to_string(value)));
}

json SizesAsJson(const VggtConfig& sizes) {
  json encoder;
  if (sizes.encoder) {
    encoder = {{"depth", sizes.encoder->depth}, {"grid_size", sizes.encoder->grid_size}};
  }
  return {{"dim", sizes.dim},
          {"depth", sizes.depth},
          {"num_heads", sizes.num_heads},
          {"num_camera_heads", sizes.num_camera_heads},
          {"num_camera_blocks", sizes.num_camera_blocks},
          {"head_layers", sizes.head_layers},
          {"encoder", encoder},
          {"num_features", sizes.dpt.num_features},
          {"num_channels", sizes.dpt.num_channels},
          {"has_point_head", sizes.has_point_head},
          {"has_distractor_head", sizes.has_distractor_head}};
}

json ScenesAsJson(const SceneStreamOptions& scenes) {
  return {{"width", scenes.width},
          {"height", scenes.height},
          {"min_views", scenes.min_views},
          {"max_views", scenes.max_views},
          {"distractor_share", scenes.distractor_share},
          {"distractor_kinds", scenes.distractor_kinds},
          {"texture_folder", scenes.texture_folder.string()},
          {"seed", scenes.seed}};
}

}  // namespace

void TrainOptions::Check() const {
  scenes.Check();
  VGTW_CHECK(lora.rank > 0 && std::isfinite(lora.alpha), "lora");
  VGTW_CHECK(lora_dropout >= 0.0 && lora_dropout < 1.0,
             "lora_dropout = " + std::to_string(lora_dropout));
  for (size_t i = 0; i < kNumTrainingLosses; ++i) {
    VGTW_CHECK(loss_weights[i] >= 0.0 && std::isfinite(loss_weights[i]),
               std::string(kTrainingLossNames[i]) + "_weight = " + std::to_string(loss_weights[i]));
  }
  VGTW_CHECK(feature_layer >= 0 && feature_layer < 4,
             "feature_layer = " + std::to_string(feature_layer));
  CheckShare(scene_share, "scene_share");
  VGTW_CHECK(num_scenes >= 0, "num_scenes = " + std::to_string(num_scenes));
  VGTW_CHECK(num_steps > 0, "num_steps = " + std::to_string(num_steps));
  VGTW_CHECK(samples_per_step > 0, "samples_per_step = " + std::to_string(samples_per_step));
  CheckPositive(learning_rate, "learning_rate");
  VGTW_CHECK(head_learning_rate >= 0.0 && std::isfinite(head_learning_rate),
             "head_learning_rate = " + std::to_string(head_learning_rate));
  CheckShare(warmup_share, "warmup_share");
  CheckShare(decay_share, "decay_share");
  VGTW_CHECK(warmup_share + decay_share <= 1.0, "warmup_share and decay_share exceed 1");
  CheckShare(weight_decay, "weight_decay");
  VGTW_CHECK(max_gradient_norm >= 0.0, "max_gradient_norm");
  VGTW_CHECK(ema_decay >= 0.0 && ema_decay < 1.0, "ema_decay = " + std::to_string(ema_decay));
  VGTW_CHECK(validate_every > 0, "validate_every = " + std::to_string(validate_every));
  VGTW_CHECK(num_validation_scenes >= 0, "num_validation_scenes");
  CheckPositive(save_every_sec, "save_every_sec");
}

LearningRateSchedule ScheduleOf(const TrainOptions& options) {
  return {.peak = options.learning_rate,
          .warmup_share = options.warmup_share,
          .decay_share = options.decay_share,
          .num_steps = options.num_steps};
}

AdamWOptions OptimiserOf(const TrainOptions& options) {
  AdamWOptions optimiser = {.weight_decay = options.weight_decay,
                            .max_group_norm = options.max_gradient_norm,
                            .ema_decay = options.ema_decay};
  if (options.head_learning_rate > 0.0) {
    const auto head = static_cast<size_t>(ParameterGroup::kDistractorHead);
    optimiser.rate_factors[head] = options.head_learning_rate / options.learning_rate;
  }
  return optimiser;
}

std::string IdentityOf(const TrainOptions& options, uint64_t start) {
  json folders = json::array();
  for (const MaskedFolder& folder : options.folders) {
    folders.push_back({folder.image_path.string(), folder.mask_path.string()});
  }
  const json identity = {{"start", start},
                         {"sizes", SizesAsJson(options.sizes)},
                         {"weights_seed", options.weights_seed},
                         {"lora_only", options.lora_only},
                         {"lora", {options.lora.rank, options.lora.alpha}},
                         {"lora_dropout", options.lora_dropout},
                         {"loss_weights", options.loss_weights},
                         {"feature_layer", options.feature_layer},
                         {"scenes", ScenesAsJson(options.scenes)},
                         {"scene_share", options.scene_share},
                         {"scene_kind", options.scene_kind},
                         {"num_scenes", options.num_scenes},
                         {"folders", folders},
                         {"samples_per_step", options.samples_per_step},
                         {"learning_rate", options.learning_rate},
                         {"head_learning_rate", options.head_learning_rate},
                         {"warmup_share", options.warmup_share},
                         {"decay_share", options.decay_share},
                         {"weight_decay", options.weight_decay},
                         {"max_gradient_norm", options.max_gradient_norm},
                         {"ema_decay", options.ema_decay},
                         {"bfloat16", options.bfloat16}};
  return identity.dump();
}

}  // namespace vgtw
