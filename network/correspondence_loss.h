// SPDX-License-Identifier: BSD-3-Clause
// What teaches a network from nothing which patches of its views show the same place. VGGT learns
// this from tracks, by a head of its own (Wang et al., section 3.4); here the trunk's features are
// asked directly, as contrastive descriptors are trained (van den Oord et al., Representation
// Learning with Contrastive Predictive Coding, section 2.3). Internal to network/: needs LibTorch.
#pragma once

#include "network/geometry_losses.h"

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Where the places that patches show lie in the other views: between four neighbouring patches.
struct PatchMatches {
  at::Tensor patch;   // [S, S, P, 4] of long: patches of view j near the place that patch p of
                      // view i shows in its middle
  at::Tensor weight;  // [S, S, P, 4]: bilinear, sum 1; all 0 where view j does not show the place
};

struct PatchMatchOptions {
  int64_t patch_size = 14;  // px
  // Depths of a place in two views that differ by less than this share show the same surface.
  double same_depth = 0.05;

  void Check() const;
};

// `distractor` [S, H, W] as in MaskLoss: what moves matches nothing. Poses and depths decide, so
// that the law holds: the same for all worlds that differ by a similarity. Pixels as in
// camera_geometry.h.
PatchMatches MatchPatches(const GeometryTruth& truth,
                          const at::Tensor& distractor,
                          const PatchMatchOptions& options = {});

// Of patch features [S, P, C]:
//   L = mean over matched patches p of i and views j of
//       - sum_q weight(q) log softmax_q(s(a_p, b_q) / temperature)
// with s the cosine and q all patches of view j. 0 where nothing matches. At the best features it
// is the entropy of the weights, not 0. Memory: 12 S^2 P^2 bytes, so this is for small networks.
at::Tensor CorrespondenceLoss(const at::Tensor& features,
                              const PatchMatches& matches,
                              double temperature = 0.1);

}  // namespace vgtw
