// SPDX-License-Identifier: BSD-3-Clause
#include "network/distractor_losses.h"

#include "network/layers.h"
#include "network/nearest_tokens.h"
#include "scene/error.h"

#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <ATen/ATen.h>
#include <torch/csrc/autograd/custom_function.h>

namespace vgtw {
namespace {

// Below this a feature has no direction.
constexpr double kMinLength = 1e-12;

// What a sum is divided by.
at::Tensor Divisor(const at::Tensor& count, Reduction reduction) {
  return reduction == Reduction::kMean ? count.clamp_min(1) : at::ones_like(count);
}

// The tokens of every view in another order: distractors first, static ones last, so that each kind
// is one range.
struct GroupedTokens {
  at::Tensor order;  // [S, P]: where each token comes from
  std::vector<TokenRange> distractors;
  std::vector<TokenRange> statics;
  std::vector<TokenRange> all;
};

GroupedTokens GroupTokens(const TokenLabels& labels) {
  GroupedTokens grouped;
  const at::Tensor rank = labels.is_static.to(at::kInt) - labels.is_distractor.to(at::kInt);
  grouped.order = std::get<1>(at::sort(rank, /*stable=*/true, /*dim=*/1, /*descending=*/false));
  const at::Tensor counts =
      at::stack({labels.is_distractor.sum(1), labels.is_static.sum(1)}).to(at::kCPU);
  const auto count = counts.accessor<int64_t, 2>();
  const int64_t num_tokens = rank.size(1);
  for (int64_t i = 0; i < rank.size(0); ++i) {
    grouped.distractors.push_back({0, count[0][i]});
    grouped.statics.push_back({num_tokens - count[1][i], num_tokens});
    grouped.all.push_back({0, num_tokens});
  }
  return grouped;
}

struct Directions {
  at::Tensor unit;     // [S, P, C], grouped, of length 1 or 0
  at::Tensor lengths;  // [S, P, 1], of the features
};

Directions Normalise(const at::Tensor& features, const at::Tensor& order) {
  std::vector<at::Tensor> lengths;
  Directions directions;
  for (int64_t i = 0; i < features.size(0); ++i) {  // view by view: small temporaries
    const at::Tensor x = AtLeastFloat(features[i].index_select(0, order[i]));
    if (i == 0) directions.unit = at::empty(features.sizes(), x.options());
    lengths.push_back(x.norm(2, {1}, /*keepdim=*/true));
    directions.unit[i].copy_(x / lengths.back().clamp_min(kMinLength));
  }
  directions.lengths = at::stack(lengths);
  return directions;
}

// A loss as a function of the similarities of tokens and their neighbours.
struct PairLoss {
  at::Tensor value;      // scalar
  at::Tensor slope;      // [S, S, P]: its derivative by each of them
  at::Tensor neighbour;  // [S, S, P]
};

PairLoss Suppress(const NearestTokens& nearest,
                  const at::Tensor& num_distractors,
                  const SuppressionOptions& options) {
  const auto [similarity, view] = nearest.similarity.max(1, /*keepdim=*/true);  // [S, 1, P]
  const at::Tensor divisor = Divisor(num_distractors, options.reduction);
  const at::Tensor is_close = (similarity > options.margin).to(similarity.scalar_type());
  return {(similarity - options.margin).relu().sum() / divisor,
          at::zeros_like(nearest.similarity).scatter_(1, view, is_close) / divisor,
          nearest.neighbour};
}

PairLoss MakeConsistent(const NearestTokens& nearest,
                        const at::Tensor& num_static,
                        const ConsistencyOptions& options) {
  const at::Tensor has_none = nearest.similarity == -std::numeric_limits<double>::infinity();
  // Who has no neighbour counts as close enough to one.
  const at::Tensor similarity = nearest.similarity.masked_fill(has_none, options.margin);
  const at::Tensor gap = (options.margin - similarity).relu();
  const at::Tensor weight = options.weight_may_be_negative ? similarity : similarity.clamp_min(0.0);
  at::Tensor slope = -weight * (gap > 0.0);
  if (options.weight_has_gradient) {
    slope += options.weight_may_be_negative ? gap : gap * (similarity > 0.0);
  }
  const int64_t num_other_views = nearest.similarity.size(0) - 1;
  const at::Tensor divisor = Divisor(num_static * num_other_views, options.reduction);
  return {(weight * gap).sum() / divisor, slope / divisor, nearest.neighbour};
}

// Adds to `gradient` [S, P, C] by the directions what `slope` [S, S, P] by the similarities means.
void AddGradient(const at::Tensor& unit,
                 const at::Tensor& slope,
                 const at::Tensor& neighbour,
                 bool neighbour_has_gradient,
                 at::Tensor& gradient) {
  for (int64_t i = 0; i < unit.size(0); ++i) {
    for (int64_t j = 0; j < unit.size(0); ++j) {
      if (i == j) continue;
      const at::Tensor rows = slope[i][j].nonzero().squeeze(1);
      if (rows.size(0) == 0) continue;
      const at::Tensor factors = slope[i][j].index_select(0, rows).unsqueeze(1);
      const at::Tensor neighbours = neighbour[i][j].index_select(0, rows);
      gradient[i].index_add_(0, rows, factors * unit[j].index_select(0, neighbours));
      if (neighbour_has_gradient) {
        gradient[j].index_add_(0, neighbours, factors * unit[i].index_select(0, rows));
      }
    }
  }
}

// Turns the gradient by directions into that by features, and the order back.
void UndoNormalise(const Directions& directions, const at::Tensor& order, at::Tensor& gradient) {
  for (int64_t i = 0; i < gradient.size(0); ++i) {
    const at::Tensor& unit = directions.unit[i];
    const at::Tensor& lengths = directions.lengths[i];
    const at::Tensor along = (unit * gradient[i]).sum(1, /*keepdim=*/true);
    const at::Tensor by_feature =
        ((gradient[i] - unit * along) / lengths).masked_fill(lengths < kMinLength, 0.0);
    gradient[i].index_copy_(0, order[i], by_feature);
  }
}

// Both losses of features with a gradient in closed form: automatic differentiation would keep a
// copy of the features per other view.
struct PairLosses : torch::autograd::Function<PairLosses> {
  static torch::autograd::variable_list forward(torch::autograd::AutogradContext* context,
                                                const at::Tensor& features,
                                                const TokenLabels& labels,
                                                const FeatureLossOptions& options) {
    const GroupedTokens tokens = GroupTokens(labels);
    const Directions directions = Normalise(features, tokens.order);
    const std::vector<NearestTokens> nearest = FindNearestTokens(
        directions.unit,
        {{tokens.distractors, tokens.all},
         {tokens.statics, options.consistency.neighbours_are_static ? tokens.statics : tokens.all}},
        options.num_tile_rows);
    const PairLoss suppression =
        Suppress(nearest[0], labels.is_distractor.sum(), options.suppression);
    const PairLoss consistency =
        MakeConsistent(nearest[1], labels.is_static.sum(), options.consistency);
    context->save_for_backward({directions.unit,
                                directions.lengths,
                                tokens.order,
                                suppression.slope,
                                suppression.neighbour,
                                consistency.slope,
                                consistency.neighbour});
    context->saved_data["suppresses_neighbour"] = options.suppression.neighbour_has_gradient;
    context->saved_data["type"] = features.scalar_type();
    return {suppression.value, consistency.value};
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list upstream) {
    const torch::autograd::variable_list saved = context->get_saved_variables();
    const Directions directions = {saved[0], saved[1]};
    at::Tensor gradient = at::zeros_like(directions.unit);
    AddGradient(directions.unit,
                saved[3] * upstream[0],
                saved[4],
                context->saved_data["suppresses_neighbour"].toBool(),
                gradient);
    AddGradient(directions.unit, saved[5] * upstream[1], saved[6], true, gradient);
    UndoNormalise(directions, saved[2], gradient);
    return {gradient.to(context->saved_data["type"].toScalarType()), at::Tensor(), at::Tensor()};
  }
};

void CheckMargin(double margin, const std::string& name) {
  VGTW_CHECK(margin >= -1.0 && margin <= 1.0,
             name + " = " + std::to_string(margin) + ", must be in [-1, 1]");
}

}  // namespace

void MaskLossOptions::Check() const {
  VGTW_CHECK(distractor_weight > 0.0,
             "MaskLossOptions::distractor_weight = " + std::to_string(distractor_weight) +
                 ", must be > 0");
}

at::Tensor MaskLoss(const at::Tensor& logits,
                    const at::Tensor& distractor,
                    const MaskLossOptions& options) {
  options.Check();
  VGTW_CHECK(logits.sizes() == distractor.sizes(), "one label per logit");
  const at::Tensor x = AtLeastFloat(logits);
  const at::Tensor is_known = distractor.isnan().logical_not();
  const at::Tensor label = distractor.to(x.scalar_type()).nan_to_num();
  const at::Tensor sum =
      at::binary_cross_entropy_with_logits(x,
                                           label,
                                           is_known.to(x.scalar_type()),
                                           at::full({1}, options.distractor_weight, x.options()),
                                           at::Reduction::Sum);
  return sum / Divisor(is_known.sum(), options.reduction);
}

void TokenLabelOptions::Check() const {
  VGTW_CHECK(patch_size > 0,
             "TokenLabelOptions::patch_size = " + std::to_string(patch_size) + ", must be > 0");
  VGTW_CHECK(static_below <= distractor_above,
             "TokenLabelOptions::static_below = " + std::to_string(static_below) +
                 ", must be <= distractor_above = " + std::to_string(distractor_above));
}

TokenLabels LabelTokens(const at::Tensor& distractor, const TokenLabelOptions& options) {
  options.Check();
  const int64_t size = options.patch_size;
  VGTW_CHECK(
      distractor.dim() == 3 && distractor.size(1) % size == 0 && distractor.size(2) % size == 0,
      "[S, H, W], whole patches");
  const auto sum_of_patches = [&](const at::Tensor& pixels) {
    return pixels
        .reshape({pixels.size(0), pixels.size(1) / size, size, pixels.size(2) / size, size})
        .sum({2, 4})
        .flatten(1, 2);  // [S, P]
  };
  // 0/0 where nothing is known, which is neither above nor below anything.
  const at::Tensor share = sum_of_patches(AtLeastFloat(distractor).nan_to_num()) /
                           sum_of_patches(distractor.isnan().logical_not());
  return {share > options.distractor_above, share < options.static_below};
}

void SuppressionOptions::Check() const { CheckMargin(margin, "SuppressionOptions::margin"); }

void ConsistencyOptions::Check() const { CheckMargin(margin, "ConsistencyOptions::margin"); }

FeatureLossOptions FeatureLossOptions::Literal() {
  FeatureLossOptions options;
  options.suppression.neighbour_has_gradient = true;
  options.suppression.reduction = Reduction::kSum;
  options.consistency.weight_has_gradient = true;
  options.consistency.weight_may_be_negative = true;
  options.consistency.neighbours_are_static = false;
  options.consistency.reduction = Reduction::kSum;
  return options;
}

void FeatureLossOptions::Check() const {
  suppression.Check();
  consistency.Check();
  VGTW_CHECK(
      num_tile_rows > 0,
      "FeatureLossOptions::num_tile_rows = " + std::to_string(num_tile_rows) + ", must be > 0");
}

FeatureLosses ComputeFeatureLosses(const at::Tensor& features,
                                   const TokenLabels& labels,
                                   const FeatureLossOptions& options) {
  options.Check();
  VGTW_CHECK(features.dim() == 3 && features.size(0) > 0, "features [S, P, C]");
  const at::IntArrayRef tokens = features.sizes().slice(0, 2);
  VGTW_CHECK(labels.is_distractor.sizes() == tokens && labels.is_static.sizes() == tokens,
             "one label per token");
  const torch::autograd::variable_list losses = PairLosses::apply(features, labels, options);
  return {losses[0], losses[1]};
}

}  // namespace vgtw
