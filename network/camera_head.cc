// SPDX-License-Identifier: BSD-3-Clause
#include "network/camera_head.h"

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr int64_t kEncodingSize = 9;
constexpr int kNumSteps = 4;
constexpr double kNormEps = 1e-5;
constexpr double kAdaptiveNormEps = 1e-6;

at::Tensor AdaptiveNorm(const at::Tensor& x) {
  return at::layer_norm(x, {x.size(-1)}, {}, {}, kAdaptiveNormEps);
}

// Fields of view cannot be negative.
at::Tensor Activate(const at::Tensor& raw) {
  return at::cat({raw.slice(2, 0, 7), raw.slice(2, 7).relu()}, 2).squeeze(0);
}

}  // namespace

CameraHead::CameraHead(const ParameterScope& scope, const VggtConfig& config)
    : token_norm_(scope["token_norm"], 2 * config.dim, kNormEps),
      trunk_norm_(scope["trunk_norm"], 2 * config.dim, kNormEps),
      empty_pose_(scope.Get("empty_pose_tokens", {1, 1, kEncodingSize})),
      embed_pose_(scope["embed_pose"], kEncodingSize, 2 * config.dim),
      modulation_(scope["poseLN_modulation"][1], 2 * config.dim, 6 * config.dim),
      fc1_(scope["pose_branch"]["fc1"], 2 * config.dim, config.dim),
      fc2_(scope["pose_branch"]["fc2"], config.dim, kEncodingSize) {
  BlockConfig block;
  block.attention = {.dim = 2 * config.dim, .num_heads = config.num_camera_heads};
  block.norm_eps = kNormEps;
  for (int64_t i = 0; i < config.num_camera_blocks; ++i) {
    trunk_.emplace_back(scope["trunk"][i], block);
  }
}

std::vector<at::Tensor> CameraHead::operator()(const at::Tensor& tokens) const {
  const at::Tensor camera_tokens = token_norm_(tokens.select(1, 0).unsqueeze(0));  // [1, S, 2 E]
  const at::Tensor normalised = AdaptiveNorm(camera_tokens);
  at::Tensor raw;
  std::vector<at::Tensor> steps;
  for (int step = 0; step < kNumSteps; ++step) {
    // The raw prediction is fed back, not the activated one, and without its gradient.
    const at::Tensor previous =
        raw.defined() ? raw.detach() : empty_pose_.expand({1, tokens.size(0), -1});
    const std::vector<at::Tensor> shift_scale_gate =
        modulation_(at::silu(embed_pose_(previous))).chunk(3, 2);
    at::Tensor x = normalised * (1.0 + shift_scale_gate[1]) + shift_scale_gate[0];
    x = shift_scale_gate[2] * x + camera_tokens;
    for (const TransformerBlock& block : trunk_) x = block(x);
    const at::Tensor change = AtLeastFloat(fc2_(at::gelu(fc1_(trunk_norm_(x)))));
    raw = raw.defined() ? raw + change : change;
    steps.push_back(Activate(raw));
  }
  return steps;
}

}  // namespace vgtw
