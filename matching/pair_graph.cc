// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_graph.h"

#include <algorithm>
#include <numeric>

namespace vgtw {

DisjointSets::DisjointSets(size_t num_elements) : parents_(num_elements), num_sets_(num_elements) {
  std::iota(parents_.begin(), parents_.end(), size_t{0});
}

size_t DisjointSets::Find(size_t element) {
  while (parents_[element] != element) {
    parents_[element] = parents_[parents_[element]];
    element = parents_[element];
  }
  return element;
}

bool DisjointSets::Join(size_t a, size_t b) {
  const size_t root_a = Find(a);
  const size_t root_b = Find(b);
  if (root_a == root_b) return false;
  parents_[std::max(root_a, root_b)] = std::min(root_a, root_b);
  --num_sets_;
  return true;
}

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
