// SPDX-License-Identifier: BSD-3-Clause
#include "tests/network/naive_losses.h"

#include <ATen/ATen.h>

namespace vgtw {

FeatureLosses NaiveLosses(const at::Tensor& features,
                          const TokenLabels& labels,
                          const FeatureLossOptions& options) {
  const at::Tensor unit = features / features.norm(2, {2}, true);
  const int64_t num_views = features.size(0);
  const auto similarity_to = [&](int64_t i, int64_t j, const at::Tensor& token, bool has_gradient) {
    const at::Tensor neighbours = unit[j].index_select(0, token);
    return (unit[i] * (has_gradient ? neighbours : neighbours.detach())).sum(1);
  };
  at::Tensor suppression = at::zeros({}, features.options());
  at::Tensor consistency = at::zeros({}, features.options());
  for (int64_t i = 0; i < num_views; ++i) {
    at::Tensor closest;
    for (int64_t j = 0; j < num_views; ++j) {
      if (j == i) continue;
      const at::Tensor all = at::mm(unit[i], unit[j].t());
      const at::Tensor s =
          similarity_to(i, j, all.argmax(1), options.suppression.neighbour_has_gradient);
      closest = closest.defined() ? at::maximum(closest, s) : s;
      at::Tensor candidates = all;
      if (options.consistency.neighbours_are_static) {
        if (!labels.is_static[j].any().item<bool>()) continue;
        candidates = all.masked_fill(labels.is_static[j].logical_not().unsqueeze(0), -2.0);
      }
      const at::Tensor c = similarity_to(i, j, candidates.argmax(1), true);
      at::Tensor weight = options.consistency.weight_has_gradient ? c : c.detach();
      if (!options.consistency.weight_may_be_negative) weight = weight.clamp_min(0.0);
      consistency = consistency +
                    (labels.is_static[i] * weight * (options.consistency.margin - c).relu()).sum();
    }
    suppression = suppression +
                  (labels.is_distractor[i] * (closest - options.suppression.margin).relu()).sum();
  }
  if (options.suppression.reduction == Reduction::kMean) {
    suppression = suppression / labels.is_distractor.sum();
  }
  if (options.consistency.reduction == Reduction::kMean) {
    consistency = consistency / (labels.is_static.sum() * (num_views - 1));
  }
  return {suppression, consistency};
}

}  // namespace vgtw
