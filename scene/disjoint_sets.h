// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace vgtw {

// Disjoint sets of 0 .. n-1, each represented by its smallest element. Index is an unsigned integer
// that holds n; memory is one Index per element.
template <typename Index = size_t>
class DisjointSets {
 public:
  explicit DisjointSets(size_t num_elements) : parents_(num_elements), num_sets_(num_elements) {
    std::iota(parents_.begin(), parents_.end(), Index{0});
  }

  Index Find(Index element) {
    while (parents_[element] != element) {
      element = parents_[element] = parents_[parents_[element]];
    }
    return element;
  }

  // Whether they were apart.
  bool Join(Index a, Index b) {
    const Index root_a = Find(a);
    const Index root_b = Find(b);
    if (root_a == root_b) return false;
    parents_[std::max(root_a, root_b)] = std::min(root_a, root_b);
    --num_sets_;
    return true;
  }

  size_t num_elements() const { return parents_.size(); }
  size_t num_sets() const { return num_sets_; }

 private:
  std::vector<Index> parents_;
  size_t num_sets_;
};

}  // namespace vgtw
