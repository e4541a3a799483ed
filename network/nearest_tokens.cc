// SPDX-License-Identifier: BSD-3-Clause
#include "network/nearest_tokens.h"

#include <algorithm>
#include <limits>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

TokenRange Intersection(const TokenRange& a, const TokenRange& b) {
  return {std::max(a.begin, b.begin), std::min(a.end, b.end)};
}

bool IsEmpty(const TokenRange& range) { return range.begin >= range.end; }

// Similarities of tokens `rows` of view i and all tokens of view j.
struct Tile {
  at::Tensor similarity;  // [rows, P]
  TokenRange rows;
  int64_t i = 0;
  int64_t j = 0;
};

// Keeps for `queries` of view `from` the better of what they have found in view `to` and what
// they find now: `similarity` is [queries, candidates] or, with `dim` = 0, its transpose.
void Improve(const at::Tensor& similarity,
             int64_t dim,
             const TokenRange& queries,
             int64_t first_candidate,
             at::Tensor best,
             at::Tensor neighbour) {
  const auto [values, indices] = similarity.max(dim);
  best = best.slice(0, queries.begin, queries.end);
  neighbour = neighbour.slice(0, queries.begin, queries.end);
  const at::Tensor is_better = (values <= best).logical_not();  // also what is not a number
  best.copy_(at::where(is_better, values, best));
  neighbour.copy_(at::where(is_better, indices + first_candidate, neighbour));
}

void SearchTile(const Tile& tile, const NeighbourSearch& search, NearestTokens& nearest) {
  const auto part = [&](const TokenRange& rows, const TokenRange& columns) {
    return tile.similarity.slice(0, rows.begin - tile.rows.begin, rows.end - tile.rows.begin)
        .slice(1, columns.begin, columns.end);
  };
  const int64_t i = tile.i;
  const int64_t j = tile.j;
  const TokenRange row_queries = Intersection(search.queries[i], tile.rows);
  if (!IsEmpty(row_queries) && !IsEmpty(search.candidates[j])) {
    Improve(part(row_queries, search.candidates[j]),
            1,
            row_queries,
            search.candidates[j].begin,
            nearest.similarity[i][j],
            nearest.neighbour[i][j]);
  }
  const TokenRange row_candidates = Intersection(search.candidates[i], tile.rows);
  if (!IsEmpty(row_candidates) && !IsEmpty(search.queries[j])) {
    Improve(part(row_candidates, search.queries[j]),
            0,
            search.queries[j],
            row_candidates.begin,
            nearest.similarity[j][i],
            nearest.neighbour[j][i]);
  }
}

}  // namespace

std::vector<NearestTokens> FindNearestTokens(const at::Tensor& features,
                                             const std::vector<NeighbourSearch>& searches,
                                             int64_t num_tile_rows) {
  const at::NoGradGuard no_gradient;
  const int64_t num_views = features.size(0);
  const int64_t num_tokens = features.size(1);
  std::vector<NearestTokens> results;
  for (size_t k = 0; k < searches.size(); ++k) {
    results.push_back(
        {at::full({num_views, num_views, num_tokens},
                  -std::numeric_limits<double>::infinity(),
                  features.options()),
         at::zeros({num_views, num_views, num_tokens}, features.options().dtype(at::kLong))});
  }
  for (int64_t i = 0; i < num_views; ++i) {
    for (int64_t j = i + 1; j < num_views; ++j) {
      for (int64_t begin = 0; begin < num_tokens; begin += num_tile_rows) {
        const TokenRange rows = {begin, std::min(begin + num_tile_rows, num_tokens)};
        const Tile tile = {
            at::mm(features[i].slice(0, rows.begin, rows.end), features[j].t()), rows, i, j};
        for (size_t k = 0; k < searches.size(); ++k) SearchTile(tile, searches[k], results[k]);
      }
    }
  }
  return results;
}

}  // namespace vgtw
