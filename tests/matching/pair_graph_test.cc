// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_graph.h"

#include "scene/random.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(HopGraph, CountsEdgesOnAChain) {
  HopGraph graph(6);
  for (size_t i = 0; i + 2 < 6; ++i) graph.AddEdge(i, i + 1);  // 5 stands alone
  EXPECT_TRUE(graph.IsWithin(2, 2, 0));
  EXPECT_FALSE(graph.IsWithin(0, 1, 0));
  EXPECT_TRUE(graph.IsWithin(0, 4, 4));
  EXPECT_FALSE(graph.IsWithin(0, 4, 3));
  EXPECT_FALSE(graph.IsWithin(0, 5, 100));
}

TEST(HopGraph, AgreesWithAllShortestPaths) {
  constexpr size_t kNumNodes = 40;
  RandomStream random(3);
  HopGraph graph(kNumNodes);
  std::vector<std::vector<int>> hops(kNumNodes, std::vector<int>(kNumNodes, 1000));
  for (size_t i = 0; i < kNumNodes; ++i) hops[i][i] = 0;
  for (int edge = 0; edge < 45; ++edge) {
    const size_t a = random.Bits() % kNumNodes;
    const size_t b = random.Bits() % kNumNodes;
    graph.AddEdge(a, b);
    if (a != b) hops[a][b] = hops[b][a] = 1;
  }
  for (size_t k = 0; k < kNumNodes; ++k) {  // Floyd and Warshall
    for (size_t i = 0; i < kNumNodes; ++i) {
      for (size_t j = 0; j < kNumNodes; ++j) {
        hops[i][j] = std::min(hops[i][j], hops[i][k] + hops[k][j]);
      }
    }
  }
  for (size_t i = 0; i < kNumNodes; ++i) {
    for (size_t j = 0; j < kNumNodes; ++j) {
      for (int max_hops = 0; max_hops < 8; ++max_hops) {
        ASSERT_EQ(graph.IsWithin(i, j, max_hops), hops[i][j] <= max_hops) << i << " " << j;
      }
    }
  }
}

}  // namespace
}  // namespace vgtw
