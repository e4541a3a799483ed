// SPDX-License-Identifier: BSD-3-Clause
// The losses of distractor-aware training (Pan et al., Visual Geometry Transformer in the Wild,
// section 4; defaults where the paper is silent or cannot be meant literally). Internal to
// network/: needs LibTorch.
// Law: all have gradients of first order, compute in float32 at least, and leave the order of views
// without effect. Where nothing is labelled a loss is 0 and so is its gradient. All Check() throw
// std::invalid_argument, as do tensors whose shapes disagree.
#pragma once

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace vgtw {

enum class Reduction { kMean, kSum };

struct MaskLossOptions {
  // How much a pixel of a distractor counts beside a static one; > 0.
  double distractor_weight = 1.0;
  Reduction reduction = Reduction::kMean;  // over known pixels; the paper sums

  void Check() const;
};

// Binary cross-entropy of `logits` of the distractor probability and what is true: 1 = distractor,
// 0 = static, NaN = unknown. Both have one shape, [S, H, W].
//   L = reduction over known pixels of  -(weight y log M + (1 - y) log(1 - M)),  M = sigmoid(logit)
at::Tensor MaskLoss(const at::Tensor& logits,
                    const at::Tensor& distractor,
                    const MaskLossOptions& options = {});

struct TokenLabelOptions {
  int64_t patch_size = 14;  // px
  // A token is a distractor where more than this share of its known pixels is, static where less
  // than that is, and neither in between, where what it shows is mixed.
  double distractor_above = 0.5;
  double static_below = 0.1;

  void Check() const;
};

// Never both; neither where nothing is known. Tokens in rows, [S, P] of bool.
struct TokenLabels {
  at::Tensor is_distractor;
  at::Tensor is_static;
};

// `distractor` [S, H, W] as in MaskLoss; H and W are multiples of the patch size.
TokenLabels LabelTokens(const at::Tensor& distractor, const TokenLabelOptions& options = {});

// Similarity s(a, b) = a b / (|a| |b|); with a feature of length 0 it is 0, without a gradient.
// Of equally similar neighbours one is chosen.
struct SuppressionOptions {
  // Similarity from which on a distractor is pushed away (gamma_d), in [-1, 1).
  double margin = 0.1;
  // Whether the neighbour is pushed away too: then static features change under a distractor.
  bool neighbour_has_gradient = false;
  Reduction reduction = Reduction::kMean;  // over distractor tokens; the paper sums

  void Check() const;
};

struct ConsistencyOptions {
  // Similarity up to which static tokens are pulled together (gamma_s), in (-1, 1].
  double margin = 0.95;
  // Whether the weight s takes part in the gradient. The loss of a pair is then s (gamma_s - s),
  // which pushes pairs below gamma_s / 2 apart.
  bool weight_has_gradient = false;
  // Whether opposite features (s < 0) have a negative weight, not 0.
  bool weight_may_be_negative = false;
  // Whether neighbours are sought among static tokens alone.
  bool neighbours_are_static = true;
  // Over pairs of a static token and another view, also if that has no static token; the paper sums
  Reduction reduction = Reduction::kMean;

  void Check() const;
};

struct FeatureLossOptions {
  SuppressionOptions suppression;
  ConsistencyOptions consistency;
  // Rows of the tiles in which similarities are computed; > 0. Changes memory alone.
  int64_t num_tile_rows = 1024;

  // The paper's equations to the letter: sums, a weight with sign and gradient, neighbours among
  // all tokens, gradients of both.
  static FeatureLossOptions Literal();
  void Check() const;
};

struct FeatureLosses {
  at::Tensor suppression;  // scalars
  at::Tensor consistency;
};

// Of patch features [S, P, C] of S views.
//   L_supp = mean over distractor tokens a of  max(0, s(a, b) - gamma_d),
//            b the token of any other view that is most similar to a
//   L_cons = mean over static tokens a and other views j of  w max(0, gamma_s - s(a, b_j)),
//            b_j the static token of view j that is most similar to a, w = max(0, s(a, b_j))
// A view without static tokens adds nothing to L_cons; one view alone has no losses.
// Both come from one search: a product of features per pair of views. Memory: one buffer like the
// float32 features forward and another one backward, plus 24 bytes S^2 P; no (S P)^2 matrix. On a
// GPU the last bits of the gradient vary from run to run, as its sums have no fixed order.
FeatureLosses ComputeFeatureLosses(const at::Tensor& features,
                                   const TokenLabels& labels,
                                   const FeatureLossOptions& options = {});

}  // namespace vgtw
