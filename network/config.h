// SPDX-License-Identifier: BSD-3-Clause
// Sizes of the networks; the defaults are those of the published weights (VGGT-1B, VGTW, Pi3).
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace vgtw {

inline constexpr int64_t kPatchSize = 14;  // pixels; sides of images are multiples of it
// Tokens before the patches of a view: one for the camera and four registers, or five registers.
inline constexpr int64_t kNumSpecialTokens = 5;

// DINOv2 with register tokens, ViT-L/14.
struct EncoderConfig {
  int64_t dim = 1024;
  int64_t depth = 24;
  int64_t num_heads = 16;
  int64_t grid_size = 37;  // side of the grid of position embeddings, in patches
};

// Low-rank update of queries and values: q += alpha / rank * B_q A_q x, v alike.
struct LoraConfig {
  int64_t rank = 32;
  double alpha = 16.0;
};

struct DptConfig {
  int64_t num_features = 256;
  std::array<int64_t, 4> num_channels = {256, 512, 1024, 1024};  // of the four layers
};

struct VggtConfig {
  // Without an encoder, patches are embedded by one convolution.
  std::optional<EncoderConfig> encoder = EncoderConfig{};
  int64_t dim = 1024;
  int64_t depth = 24;  // pairs of a frame block and a global block
  int64_t num_heads = 16;
  int64_t num_camera_heads = 16;  // attention heads of the camera head
  int64_t num_camera_blocks = 4;  // its depth
  std::array<int64_t, 4> head_layers = {4, 11, 17, 23};
  DptConfig dpt = {};
  bool has_point_head = true;  // nothing else needs its points: small networks do without
  // Both for VGTW; the distractor head has the official prefix "mask_head".
  std::optional<LoraConfig> lora = {};
  bool has_distractor_head = false;
};

struct Pi3Config {
  EncoderConfig encoder;
  int64_t depth = 36;  // decoder blocks; even ones within a view, odd ones across views
  int64_t head_dim = 1024;
  int64_t num_head_heads = 16;
  int64_t camera_dim = 512;
  // For VGTW(pi3): blocks 2k and 2k + 1 are layer k, whose two outputs the distractor head reads.
  std::optional<LoraConfig> lora = {};
  bool has_distractor_head = false;
  std::array<int64_t, 4> head_layers = {3, 8, 13, 17};
  DptConfig dpt = {};
};

}  // namespace vgtw
