// SPDX-License-Identifier: BSD-3-Clause
#include "network/probe.h"

#include "network/config.h"
#include "scene/error.h"

#include <ATen/ATen.h>

namespace vgtw {
namespace {

// Cosine between one patch and all patches [S, P, C] -> [S, P].
at::Tensor CosineTo(const at::Tensor& patches, int64_t view, int64_t patch) {
  const at::Tensor unit = patches / patches.norm(2, {2}, /*keepdim=*/true).clamp_min(1e-12);
  return at::matmul(unit, unit[view][patch]);
}

}  // namespace

PatchProbe ProbePatch(const Model& model,
                      const at::Tensor& images,
                      const PatchQuery& query,
                      const at::Tensor& excluded_patches) {
  const int64_t num_rows = images.size(2) / kPatchSize;
  const int64_t num_columns = images.size(3) / kPatchSize;
  VGTW_CHECK(query.view >= 0 && query.view < images.size(0), "view of the query");
  VGTW_CHECK(
      query.row >= 0 && query.row < num_rows && query.column >= 0 && query.column < num_columns,
      "patch of the query");
  at::Tensor tokens;
  EncodeOptions options;
  options.excluded_patches = excluded_patches;
  options.on_layer = [&](int64_t layer, const at::Tensor& of_layer) {
    if (layer == query.layer) tokens = of_layer;
  };
  model.Encode(images, options);
  VGTW_CHECK(tokens.defined(), "layer of the query");

  const int64_t patch = query.row * num_columns + query.column;
  const at::Tensor attention = model.GlobalAttentionOf(
      query.view, kNumSpecialTokens + patch, query.layer, tokens, images.size(2), images.size(3));
  const std::vector<int64_t> map_shape = {images.size(0), num_rows, num_columns};
  return {CosineTo(tokens.slice(1, kNumSpecialTokens), query.view, patch).view(map_shape),
          attention.slice(1, kNumSpecialTokens).reshape(map_shape),
          attention.slice(1, 0, kNumSpecialTokens).sum().item<double>()};
}

}  // namespace vgtw
