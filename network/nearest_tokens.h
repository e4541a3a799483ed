// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include <cstdint>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Tokens [begin, end) of a view.
struct TokenRange {
  int64_t begin = 0;
  int64_t end = 0;
};

// Which tokens of each view look for a neighbour, and which ones of other views may be it.
struct NeighbourSearch {
  std::vector<TokenRange> queries;
  std::vector<TokenRange> candidates;
};

// At [i, j, a] what token a of view i finds in view j.
struct NearestTokens {
  at::Tensor similarity;  // [S, S, P]; -inf where nothing is sought or found, as for i = j
  at::Tensor neighbour;   // [S, S, P], int64, token of view j; 0 where there is none
};

// The candidate of every other view with the largest inner product with each query, for several
// searches at the price of one: one product of matrices per unordered pair of views, whose rows
// serve one direction and whose columns the other, in tiles of `num_tile_rows`. `features`
// [S, P, C]. A feature that is not a number finds one that is not either. No gradient.
std::vector<NearestTokens> FindNearestTokens(const at::Tensor& features,
                                             const std::vector<NeighbourSearch>& searches,
                                             int64_t num_tile_rows);

}  // namespace vgtw
