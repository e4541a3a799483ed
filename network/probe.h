// SPDX-License-Identifier: BSD-3-Clause
// What a patch looks at and what looks like it: the paper's analysis of where distractors leak into
// the static scene (section 3.2), and a tool for finding out why a view went wrong. Internal to
// network/: needs LibTorch.
#pragma once

#include "network/model.h"

#include <cstdint>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// One patch of one view, in patches from the top left.
struct PatchQuery {
  int64_t view = 0;
  int64_t row = 0;
  int64_t column = 0;
};

// Both [S, rows, columns] over the patches of all views.
struct PatchProbe {
  at::Tensor similarity;  // cosine between the layer's tokens, -1 .. 1; the query itself has 1
  at::Tensor attention;   // of the global block, mean over heads; sums to 1 - special_attention
  double special_attention = 0.0;  // that goes to camera and register tokens
};

// One probe for each of `layers`, pairs of a frame block and a global block counted from 0.
// images [S, 3, H, W] in [0, 1]; `encode` as for Model::Encode. Throws std::invalid_argument if the
// query or a layer does not exist.
std::vector<PatchProbe> ProbePatch(const Model& model,
                                   const at::Tensor& images,
                                   const PatchQuery& query,
                                   const std::vector<int64_t>& layers,
                                   const EncodeOptions& encode = {});

}  // namespace vgtw
