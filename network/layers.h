// SPDX-License-Identifier: BSD-3-Clause
// The layers that the networks are made of. Internal to network/: needs LibTorch.
// Law: a layer computes in the type of its parameters and converts what it is given; norms and
// residual streams are float32. In mixed precision this equals PyTorch's autocast.
#pragma once

#include "network/config.h"
#include "network/parameters.h"
#include "network/rotary_embedding.h"

#include <cstdint>
#include <optional>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Half precision becomes float32; wider types stay, so that gradients can be checked in double.
at::Tensor AtLeastFloat(const at::Tensor& x);

// x [..., in] -> x W^T + b [..., out].
class Linear {
 public:
  Linear(const ParameterScope& scope, int64_t num_inputs, int64_t num_outputs);
  at::Tensor operator()(const at::Tensor& x) const;

 private:
  at::Tensor weight_;
  at::Tensor bias_;
};

// Over the last dimension. eps differs from place to place and is part of the weights' meaning:
// 1e-6 in DINOv2 and pi3's blocks, else 1e-5.
class LayerNorm {
 public:
  LayerNorm(const ParameterScope& scope, int64_t dim, double eps);
  at::Tensor operator()(const at::Tensor& x) const;

 private:
  at::Tensor weight_;
  at::Tensor bias_;
  double eps_;
};

struct ConvolutionConfig {
  int64_t num_inputs = 0;
  int64_t num_outputs = 0;
  int64_t kernel = 1;
  int64_t stride = 1;
  int64_t padding = 0;
  bool has_bias = true;
};

// x [N, in, h, w] -> [N, out, h', w'].
class Convolution {
 public:
  Convolution(const ParameterScope& scope, const ConvolutionConfig& config);
  at::Tensor operator()(const at::Tensor& x) const;

 private:
  at::Tensor weight_;
  at::Tensor bias_;
  int64_t stride_;
  int64_t padding_;
};

// Transposed convolution whose kernel equals its stride: every pixel becomes a stride x stride
// tile.
class Upsampling {
 public:
  Upsampling(const ParameterScope& scope, int64_t num_channels, int64_t stride);
  at::Tensor operator()(const at::Tensor& x) const;

 private:
  at::Tensor weight_;
  at::Tensor bias_;
  int64_t stride_;
};

struct AttentionConfig {
  int64_t dim = 1024;
  int64_t num_heads = 16;
  bool has_qk_norm = false;  // LayerNorm over each head's queries and keys, eps 1e-5
  std::optional<LoraConfig> lora = {};
};

// Multi-head self-attention over x [B, N, dim].
class Attention {
 public:
  Attention(const ParameterScope& scope, const AttentionConfig& config);
  // `rotary`: positions of the tokens, nullptr for none; N must be a multiple of its length.
  // `excluded_keys` [B, N] or undefined: true = no token attends to this one.
  at::Tensor operator()(const at::Tensor& x,
                        const RotaryTable* rotary,
                        const at::Tensor& excluded_keys = {}) const;
  // How much token `query` of x [1, N, dim] attends to each token: [N], mean over the heads.
  at::Tensor WeightsOf(int64_t query,
                       const at::Tensor& x,
                       const RotaryTable* rotary,
                       const at::Tensor& excluded_keys = {}) const;

  int64_t head_dim() const { return head_dim_; }

 private:
  struct Projections {
    at::Tensor q, k, v;  // [B, heads, N, dim / heads], one type
  };
  struct Lora {
    at::Tensor down;  // A [rank, dim]
    at::Tensor up;    // B [dim, rank]
  };
  Projections Project(const at::Tensor& x, const RotaryTable* rotary) const;
  at::Tensor ToHeads(const at::Tensor& x) const;  // [B, N, dim] -> [B, heads, N, dim / heads]
  at::Tensor Update(const Lora& lora, const at::Tensor& x) const;

  int64_t num_heads_;
  int64_t head_dim_;
  Linear qkv_;
  Linear proj_;
  std::optional<LayerNorm> q_norm_;
  std::optional<LayerNorm> k_norm_;
  std::optional<Lora> lora_q_;
  std::optional<Lora> lora_v_;
  double lora_scale_ = 0.0;
};

struct BlockConfig {
  AttentionConfig attention;
  double norm_eps = 1e-5;
  bool has_layer_scale = true;
};

// Pre-norm transformer block: x += ls1 * attention(norm1 x); x += ls2 * mlp(norm2 x). The hidden
// layer of the mlp is four times as wide; its GELU is the exact one.
class TransformerBlock {
 public:
  TransformerBlock(const ParameterScope& scope, const BlockConfig& config);
  at::Tensor operator()(const at::Tensor& x,
                        const RotaryTable* rotary = nullptr,
                        const at::Tensor& excluded_keys = {}) const;
  // The attention inside this block, see Attention::WeightsOf.
  at::Tensor AttentionWeightsOf(int64_t query,
                                const at::Tensor& x,
                                const RotaryTable* rotary,
                                const at::Tensor& excluded_keys = {}) const {
    return attention_.WeightsOf(query, norm1_(x), rotary, excluded_keys);
  }

  int64_t head_dim() const { return attention_.head_dim(); }

 private:
  at::Tensor Run(const at::Tensor& x,
                 const RotaryTable* rotary,
                 const at::Tensor& excluded_keys) const;

  LayerNorm norm1_;
  Attention attention_;
  LayerNorm norm2_;
  Linear fc1_;
  Linear fc2_;
  at::Tensor scale1_;  // undefined without layer scale
  at::Tensor scale2_;
};

}  // namespace vgtw
