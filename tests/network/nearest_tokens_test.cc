// SPDX-License-Identifier: BSD-3-Clause
#include "network/nearest_tokens.h"

#include <limits>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// One pair of tokens after the other.
NearestTokens SearchOneByOne(const at::Tensor& features, const NeighbourSearch& search) {
  const int64_t num_views = features.size(0);
  const int64_t num_tokens = features.size(1);
  NearestTokens nearest = {
      at::full({num_views, num_views, num_tokens}, -kInfinity, features.options()),
      at::zeros({num_views, num_views, num_tokens}, at::kLong)};
  for (int64_t i = 0; i < num_views; ++i) {
    for (int64_t j = 0; j < num_views; ++j) {
      if (i == j) continue;
      for (int64_t a = search.queries[i].begin; a < search.queries[i].end; ++a) {
        for (int64_t b = search.candidates[j].begin; b < search.candidates[j].end; ++b) {
          const at::Tensor similarity = features[i][a].dot(features[j][b]);
          if (similarity.item<double>() <= nearest.similarity[i][j][a].item<double>()) continue;
          nearest.similarity[i][j][a].copy_(similarity);
          nearest.neighbour[i][j][a].fill_(b);
        }
      }
    }
  }
  return nearest;
}

TEST(NearestTokens, AreThoseOfOneByOneSearchInTilesOfAnySize) {
  at::manual_seed(1);
  const at::Tensor features = at::randn({3, 9, 5}, at::kDouble);
  const NeighbourSearch everything = {{{0, 9}, {0, 9}, {0, 9}}, {{0, 9}, {0, 9}, {0, 9}}};
  // One view asks for nothing, another one offers nothing.
  const NeighbourSearch some = {{{2, 8}, {0, 0}, {5, 9}}, {{0, 3}, {4, 9}, {7, 7}}};
  for (const int64_t num_tile_rows : {1, 2, 7, 1024}) {
    const std::vector<NearestTokens> found =
        FindNearestTokens(features, {everything, some}, num_tile_rows);
    ASSERT_EQ(found.size(), 2u);
    for (const size_t k : {0, 1}) {
      const NearestTokens expected = SearchOneByOne(features, k == 0 ? everything : some);
      EXPECT_TRUE(at::equal(found[k].neighbour, expected.neighbour)) << num_tile_rows;
      EXPECT_TRUE(at::allclose(found[k].similarity, expected.similarity, 1e-12, 1e-12))
          << num_tile_rows;
    }
  }
}

TEST(NearestTokens, NotANumberIsPassedOn) {
  at::Tensor features = at::ones({2, 4, 3});
  features[1][2].fill_(std::numeric_limits<double>::quiet_NaN());
  const NeighbourSearch everything = {{{0, 4}, {0, 4}}, {{0, 4}, {0, 4}}};
  for (const int64_t num_tile_rows : {1, 1024}) {
    const NearestTokens found = FindNearestTokens(features, {everything}, num_tile_rows)[0];
    EXPECT_TRUE(found.similarity[1][0][2].isnan().item<bool>());
    EXPECT_TRUE(found.similarity[0][1].isnan().all().item<bool>());
    EXPECT_EQ(found.similarity[1][0][3].item<float>(), 3.0f);
  }
}

}  // namespace
}  // namespace vgtw
