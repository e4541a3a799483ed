// SPDX-License-Identifier: BSD-3-Clause
#include "network/layers.h"

#include "network/attention.h"
#include "network/training_mode.h"
#include "scene/error.h"

#include <cmath>
#include <limits>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr int64_t kMlpRatio = 4;
constexpr double kQkNormEps = 1e-5;

at::Tensor GetScale(const ParameterScope& scope, const BlockConfig& config) {
  return config.has_layer_scale ? scope.Get("gamma", {config.attention.dim}) : at::Tensor();
}

at::Tensor AddScaled(const at::Tensor& x, const at::Tensor& change, const at::Tensor& scale) {
  if (!scale.defined()) return x + change;
  return at::addcmul(x, change.to(x.scalar_type()), scale);
}

}  // namespace

at::Tensor AtLeastFloat(const at::Tensor& x) {
  return at::elementSize(x.scalar_type()) < at::elementSize(at::kFloat) ? x.to(at::kFloat) : x;
}

Linear::Linear(const ParameterScope& scope, int64_t num_inputs, int64_t num_outputs)
    : weight_(scope.GetForProduct("weight", {num_outputs, num_inputs})),
      bias_(scope.GetForProduct("bias", {num_outputs})) {}

at::Tensor Linear::operator()(const at::Tensor& x) const {
  return at::linear(x.to(weight_.scalar_type()), weight_, bias_);
}

LayerNorm::LayerNorm(const ParameterScope& scope, int64_t dim, double eps)
    : weight_(scope.Get("weight", {dim})), bias_(scope.Get("bias", {dim})), eps_(eps) {}

at::Tensor LayerNorm::operator()(const at::Tensor& x) const {
  return at::layer_norm(x.to(weight_.scalar_type()), weight_.sizes(), weight_, bias_, eps_);
}

Convolution::Convolution(const ParameterScope& scope, const ConvolutionConfig& config)
    : weight_(scope.GetForProduct(
          "weight", {config.num_outputs, config.num_inputs, config.kernel, config.kernel})),
      stride_(config.stride),
      padding_(config.padding) {
  if (config.has_bias) bias_ = scope.GetForProduct("bias", {config.num_outputs});
}

at::Tensor Convolution::operator()(const at::Tensor& x) const {
  return at::conv2d(x.to(weight_.scalar_type()), weight_, bias_, stride_, padding_);
}

Upsampling::Upsampling(const ParameterScope& scope, int64_t num_channels, int64_t stride)
    : weight_(scope.GetForProduct("weight", {num_channels, num_channels, stride, stride})),
      bias_(scope.GetForProduct("bias", {num_channels})),
      stride_(stride) {
  // On CPUs LibTorch 1.13 has no such product of 16 bits, or a wrong one.
  if (!weight_.is_cpu()) return;
  weight_ = AtLeastFloat(weight_);
  bias_ = AtLeastFloat(bias_);
}

at::Tensor Upsampling::operator()(const at::Tensor& x) const {
  return at::conv_transpose2d(x.to(weight_.scalar_type()), weight_, bias_, stride_);
}

Attention::Attention(const ParameterScope& scope, const AttentionConfig& config)
    : num_heads_(config.num_heads),
      head_dim_(config.dim / config.num_heads),
      qkv_(scope["qkv"], config.dim, 3 * config.dim),
      proj_(scope["proj"], config.dim, config.dim) {
  VGTW_CHECK(config.dim % config.num_heads == 0, "attention heads");
  if (config.has_qk_norm) {
    q_norm_.emplace(scope["q_norm"], head_dim_, kQkNormEps);
    k_norm_.emplace(scope["k_norm"], head_dim_, kQkNormEps);
  }
  if (!config.lora) return;
  const Shape down = {config.lora->rank, config.dim};
  const Shape up = {config.dim, config.lora->rank};
  lora_q_ = Lora{scope.GetForProduct("lora_A_q", down), scope.GetForProduct("lora_B_q", up)};
  lora_v_ = Lora{scope.GetForProduct("lora_A_v", down), scope.GetForProduct("lora_B_v", up)};
  lora_scale_ = config.lora->alpha / static_cast<double>(config.lora->rank);
}

at::Tensor Attention::ToHeads(const at::Tensor& x) const {
  return x.reshape({x.size(0), x.size(1), num_heads_, head_dim_}).transpose(1, 2);
}

at::Tensor Attention::Update(const Lora& lora, const at::Tensor& x) const {
  const at::Tensor reduced = at::linear(DropLoraInputs(x).to(lora.down.scalar_type()), lora.down);
  return ToHeads(at::linear(reduced, lora.up)) * lora_scale_;
}

Attention::Projections Attention::Project(const at::Tensor& x, const RotaryTable* rotary) const {
  const std::vector<at::Tensor> parts = qkv_(x).chunk(3, 2);
  at::Tensor q = ToHeads(parts[0]);
  at::Tensor k = ToHeads(parts[1]);
  at::Tensor v = ToHeads(parts[2]);
  const at::ScalarType product_type = v.scalar_type();
  if (q_norm_) q = (*q_norm_)(q);
  if (k_norm_) k = (*k_norm_)(k);
  if (rotary != nullptr) {
    q = Rotate(q, *rotary);
    k = Rotate(k, *rotary);
  }
  // After norm and rotation, as the released weights were trained: it cannot be merged into qkv.
  if (lora_q_) q = q + Update(*lora_q_, x);
  if (lora_v_) v = v + Update(*lora_v_, x);
  return {q.to(product_type), k.to(product_type), v};
}

at::Tensor Attention::operator()(const at::Tensor& x,
                                 const RotaryTable* rotary,
                                 const at::Tensor& excluded_keys) const {
  const Projections heads = Project(x, rotary);
  const at::Tensor attended = Attend(heads.q, heads.k, heads.v, excluded_keys);
  return proj_(attended.transpose(1, 2).reshape(x.sizes()));
}

at::Tensor Attention::WeightsOf(int64_t query,
                                const at::Tensor& x,
                                const RotaryTable* rotary,
                                const at::Tensor& excluded_keys) const {
  const Projections heads = Project(x, rotary);
  const at::Tensor q = AtLeastFloat(heads.q[0].slice(1, query, query + 1));  // [heads, 1, d]
  const at::Tensor k = AtLeastFloat(heads.k[0]);
  at::Tensor logits = at::bmm(q, k.transpose(1, 2)) / std::sqrt(static_cast<double>(head_dim_));
  if (excluded_keys.defined()) {
    logits = logits.masked_fill(excluded_keys, -std::numeric_limits<double>::infinity());
  }
  return at::softmax(logits, 2).mean(0).squeeze(0);
}

TransformerBlock::TransformerBlock(const ParameterScope& scope, const BlockConfig& config)
    : norm1_(scope["norm1"], config.attention.dim, config.norm_eps),
      attention_(scope["attn"], config.attention),
      norm2_(scope["norm2"], config.attention.dim, config.norm_eps),
      fc1_(scope["mlp"]["fc1"], config.attention.dim, kMlpRatio * config.attention.dim),
      fc2_(scope["mlp"]["fc2"], kMlpRatio * config.attention.dim, config.attention.dim),
      scale1_(GetScale(scope["ls1"], config)),
      scale2_(GetScale(scope["ls2"], config)) {}

at::Tensor TransformerBlock::operator()(const at::Tensor& x,
                                        const RotaryTable* rotary,
                                        const at::Tensor& excluded_keys) const {
  const auto run =
      [this, excluded_keys, table = rotary != nullptr ? std::optional(*rotary) : std::nullopt](
          const at::Tensor& input) { return Run(input, table ? &*table : nullptr, excluded_keys); };
  return RunBlock(run, x);
}

at::Tensor TransformerBlock::Run(const at::Tensor& x,
                                 const RotaryTable* rotary,
                                 const at::Tensor& excluded_keys) const {
  const at::Tensor attended = AddScaled(x, attention_(norm1_(x), rotary, excluded_keys), scale1_);
  return AddScaled(attended, fc2_(at::gelu(fc1_(norm2_(attended)))), scale2_);
}

}  // namespace vgtw
