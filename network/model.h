// SPDX-License-Identifier: BSD-3-Clause
// What all networks have in common. Internal to network/: needs LibTorch.
#pragma once

#include "network/layers.h"

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// What the trunk of a network makes of S views of height x width pixels.
struct Features {
  int64_t height = 0;
  int64_t width = 0;
  // What the dense heads read: four times [S, 5 + P, 2 E] for VGGT. For pi3 only the last is what
  // its own heads read, and the others exist if it has a distractor head.
  std::array<at::Tensor, 4> layers;
  at::Tensor last;  // [S, 5 + P, 2 E] of the last layer

  int64_t num_views() const { return last.size(0); }
};

struct EncodeOptions {
  // [S, P] or undefined: true = no token of the trunk attends to this patch.
  at::Tensor excluded_patches = {};
  // Called after every transformer block of the encoder and the trunk.
  std::function<void()> on_block = {};
  // Sees the tokens [S, 5 + P, 2 E] of every layer, for tests and pictures.
  std::function<void(int64_t layer, const at::Tensor& tokens)> on_layer = {};
};

// Frames as in the official code: OpenCV axes, pixel centres at integers.
struct CameraOutputs {
  at::Tensor pose_encodings = {};  // VGGT: [4, S, 9], the four steps of the camera head
  at::Tensor cam_from_world = {};  // [S, 3, 4]
  at::Tensor intrinsics = {};      // [S, 3, 3], pixels; undefined for pi3, see scene/pinhole_fit.h
};

// Of n = end - begin views; undefined what a network does not predict.
struct DenseOutputs {
  at::Tensor depth = {};              // [n, H, W]
  at::Tensor depth_conf = {};         // [n, H, W], > 1 for VGGT; pi3: logit
  at::Tensor points = {};             // VGGT with a point head: [n, H, W, 3] in the world
  at::Tensor points_conf = {};        // VGGT: [n, H, W]
  at::Tensor local_points = {};       // pi3: [n, H, W, 3] in the frame of the camera
  at::Tensor distractor_logits = {};  // [n, H, W]
};

struct MapChoice {
  // VGGT's and VGTW's points have a head of their own, as costly as depth; pi3's come with depth.
  bool points = true;
  bool depth = true;       // with its confidence
  bool distractor = true;  // where the network has such a head
};

class Model {
 public:
  virtual ~Model() = default;
  // images [S, 3, H, W] in [0, 1], sides multiples of the patch size.
  virtual Features Encode(const at::Tensor& images, const EncodeOptions& options) const = 0;
  virtual CameraOutputs PredictCameras(const Features& features) const = 0;
  // Maps of the views begin .. end - 1: no view needs the others, so few at a time bound the
  // memory.
  virtual DenseOutputs PredictMaps(const Features& features,
                                   int64_t begin,
                                   int64_t end,
                                   const MapChoice& choice) const = 0;
  // The block of `layer` that looks across all views; throws std::out_of_range.
  virtual const TransformerBlock& GlobalBlock(int64_t layer) const = 0;
};

// Which tokens of [S, 5 + P] to leave out of attention, from patches [S, P]; undefined stays so.
at::Tensor ExcludedTokens(const at::Tensor& excluded_patches);

// What the global block of a layer read, [1, S * T, E]: the first half of its tokens [S, T, 2 E].
at::Tensor GlobalInputOf(const at::Tensor& tokens);

// The four layers of the views begin .. end - 1.
std::array<at::Tensor, 4> SliceViews(const Features& features, int64_t begin, int64_t end);

}  // namespace vgtw
