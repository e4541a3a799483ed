// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace vgtw {

// An undirected graph that grows edge by edge.
class HopGraph {
 public:
  explicit HopGraph(size_t num_nodes);

  void AddEdge(size_t a, size_t b);
  // Whether at most `max_hops` edges lead from a to b.
  bool IsWithin(size_t a, size_t b, int max_hops);

 private:
  struct Ball {
    std::vector<size_t> nodes;  // visited so far
    size_t first_on_rim = 0;    // the others' neighbours are visited as well
  };
  // Visits the neighbours of the rim; true if it meets the other ball.
  bool Grow(Ball& ball, size_t own_mark, size_t other_mark);

  std::vector<std::vector<size_t>> neighbours_;
  std::vector<size_t> marks_;  // of the ball that visited a node last
  size_t last_mark_ = 0;
};

}  // namespace vgtw
