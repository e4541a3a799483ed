// SPDX-License-Identifier: BSD-3-Clause
#include "network/probe.h"

#include "network/config.h"
#include "scene/error.h"

#include <algorithm>
#include <map>
#include <string>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

// Cosine between one patch and all patches [S, P, C] -> [S, P].
at::Tensor CosineTo(const at::Tensor& patches, int64_t view, int64_t patch) {
  const at::Tensor unit = patches / patches.norm(2, {2}, /*keepdim=*/true).clamp_min(1e-12);
  return at::matmul(unit, unit[view][patch]);
}

}  // namespace

std::vector<PatchProbe> ProbePatch(const Model& model,
                                   const at::Tensor& images,
                                   const PatchQuery& query,
                                   const std::vector<int64_t>& layers,
                                   const EncodeOptions& encode) {
  const int64_t num_views = images.size(0);
  const int64_t num_rows = images.size(2) / kPatchSize;
  const int64_t num_columns = images.size(3) / kPatchSize;
  VGTW_CHECK(query.view >= 0 && query.view < num_views, "view of the query");
  VGTW_CHECK(
      query.row >= 0 && query.row < num_rows && query.column >= 0 && query.column < num_columns,
      "patch of the query");
  std::map<int64_t, at::Tensor> tokens_of_layer;
  EncodeOptions options = encode;
  options.on_layer = [&](int64_t layer, const at::Tensor& tokens) {
    if (std::find(layers.begin(), layers.end(), layer) != layers.end()) {
      tokens_of_layer[layer] = tokens;
    }
    if (encode.on_layer) encode.on_layer(layer, tokens);
  };
  model.Encode(images, options);

  const at::Tensor excluded = ExcludedTokens(encode.excluded_patches);
  const int64_t patch = query.row * num_columns + query.column;
  const int64_t num_tokens = kNumSpecialTokens + num_rows * num_columns;
  std::vector<PatchProbe> probes;
  for (const int64_t layer : layers) {
    VGTW_CHECK(tokens_of_layer.contains(layer), "layer " + std::to_string(layer));
    const at::Tensor& tokens = tokens_of_layer[layer];
    const TransformerBlock& block = model.GlobalBlock(layer);
    const RotaryTable rotary = MakeRotaryTable(
        kNumSpecialTokens, num_rows, num_columns, block.head_dim(), images.device());
    const at::Tensor attention =
        block
            .AttentionWeightsOf(query.view * num_tokens + kNumSpecialTokens + patch,
                                GlobalInputOf(tokens),
                                &rotary,
                                excluded.defined() ? excluded.view({-1}) : excluded)
            .view({num_views, num_tokens});
    const std::vector<int64_t> map_shape = {num_views, num_rows, num_columns};
    probes.push_back(
        {CosineTo(tokens.slice(1, kNumSpecialTokens), query.view, patch).view(map_shape),
         attention.slice(1, kNumSpecialTokens).reshape(map_shape),
         attention.slice(1, 0, kNumSpecialTokens).sum().item<double>()});
  }
  return probes;
}

}  // namespace vgtw
