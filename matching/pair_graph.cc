// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_graph.h"

namespace vgtw {

HopGraph::HopGraph(size_t num_nodes) : neighbours_(num_nodes), marks_(num_nodes, 0) {}

void HopGraph::AddEdge(size_t a, size_t b) {
  neighbours_[a].push_back(b);
  neighbours_[b].push_back(a);
}

bool HopGraph::Grow(Ball& ball, size_t own_mark, size_t other_mark) {
  const size_t end_of_rim = ball.nodes.size();
  for (; ball.first_on_rim < end_of_rim; ++ball.first_on_rim) {
    for (const size_t node : neighbours_[ball.nodes[ball.first_on_rim]]) {
      if (marks_[node] == other_mark) return true;
      if (marks_[node] == own_mark) continue;
      marks_[node] = own_mark;
      ball.nodes.push_back(node);
    }
  }
  return false;
}

bool HopGraph::IsWithin(size_t a, size_t b, int max_hops) {
  if (a == b) return true;
  const size_t mark_a = ++last_mark_;
  const size_t mark_b = ++last_mark_;
  Ball ball_a{{a}};
  Ball ball_b{{b}};
  marks_[a] = mark_a;
  marks_[b] = mark_b;
  for (int hop = 0; hop < max_hops; ++hop) {
    const bool grow_a = ball_a.nodes.size() <= ball_b.nodes.size();
    if (grow_a ? Grow(ball_a, mark_a, mark_b) : Grow(ball_b, mark_b, mark_a)) return true;
  }
  return false;
}

}  // namespace vgtw
