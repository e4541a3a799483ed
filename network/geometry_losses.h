// SPDX-License-Identifier: BSD-3-Clause
// The losses of training cameras and depths (Wang et al., VGGT: Visual Geometry Grounded
// Transformer, section 3.4). Internal to network/: needs LibTorch.
// Law: all are 0 with gradient 0 at what is true, but for what a confidence earns, and where
// nothing is known. All Check() throw std::invalid_argument, as do tensors whose shapes disagree.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// What is true of the S views of a scene, in frames and pixels of camera_geometry.h.
struct GeometryTruth {
  at::Tensor depth;           // [S, H, W], z-depth in scene units; unknown where not finite or <= 0
  at::Tensor cam_from_world;  // [S, 3, 4]
  at::Tensor intrinsics;      // [S, 3, 3], pixels
};

// True where the depth is known.
at::Tensor IsKnownDepth(const at::Tensor& depth);

// Whose points have a mean distance of 1 from the first camera.
enum class ScaleViews { kAll, kFirst };

struct NormalisedTruth {
  GeometryTruth truth;
  double scale = 1.0;  // scene units per normalised one
};

// The frame and unit in which networks predict: the world is the frame of the first camera, the
// mean distance of points with known depth from its centre is 1. Unknown depths become 0. Law: the
// same for all worlds that differ by a similarity. nullopt if that mean is no positive number, as
// where no depth of these views is known.
std::optional<NormalisedTruth> NormaliseTruth(const GeometryTruth& truth,
                                              ScaleViews scale_views = ScaleViews::kAll);

struct CameraLossOptions {
  // Error from which on the loss is linear; 0 = everywhere (L1). An element of an encoding that is
  // further off counts |error| - scale / 2, others error^2 / (2 scale).
  double huber_scale = 0.0;
  double translation_weight = 1.0;
  double rotation_weight = 1.0;
  double field_of_view_weight = 0.5;
  // Weight of an iteration of the camera head beside the next one; in (0, 1].
  double iteration_decay = 0.6;

  void Check() const;
};

// Of all n iterations of the camera head, pose encodings [S, 9] (see camera_geometry.h), and the
// true encodings, whose quaternions have length 1.
//   L = 1/n sum_i decay^(n - 1 - i) sum over parts of weight * mean |error|
// Of a rotation's two quaternions the one that is nearer to the prediction is the true one.
at::Tensor CameraLoss(const std::vector<at::Tensor>& encodings,
                      const at::Tensor& true_encodings,
                      const CameraLossOptions& options = {});

struct MapLossOptions {
  // What a confidence earns: the best one for an error e is alpha / e; > 0.
  double alpha = 0.2;
  // Of the differences between neighbouring pixels; 0 = none.
  double gradient_weight = 1.0;
  // Scales of those differences: every pixel, every 2nd, every 4th, ...
  int num_gradient_scales = 3;

  void Check() const;
};

// Of depths, their confidences (> 0) and what is true, all [S, H, W]. With error e = d - d*,
//   L = mean over known pixels of (c |e| - alpha log c)
//     + weight * sum over scales of mean over pairs of known neighbours of |e(p) - e(q)|
at::Tensor DepthLoss(const at::Tensor& depth,
                     const at::Tensor& confidence,
                     const at::Tensor& true_depth,
                     const MapLossOptions& options = {});

// The same of points [S, H, W, 3] of the world and their confidences [S, H, W]; means are also over
// x, y and z. Points are known where the depths of `truth` are.
at::Tensor PointLoss(const at::Tensor& points,
                     const at::Tensor& confidence,
                     const GeometryTruth& truth,
                     const MapLossOptions& options = {});

}  // namespace vgtw
