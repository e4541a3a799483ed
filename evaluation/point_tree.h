// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/sim3d.h"

#include <compare>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// One point of a cloud as seen from a query.
struct Neighbour {
  double squared_distance = 0.0;
  uint32_t idx = 0;  // in the cloud
  auto operator<=>(const Neighbour&) const = default;
};

// Exact nearest neighbours among the points of a cloud: a balanced k-d tree with the bounding box
// of every node, in double precision. Law: neighbours are the smallest by (squared distance,
// index), so that the answer is that of an exhaustive search, also among equal points, whatever the
// number of threads. Takes about 40 bytes per point.
class PointTree {
 public:
  // Throws std::invalid_argument if there is no point, one is not finite, or 2^32 - 1 or more.
  explicit PointTree(const std::vector<Eigen::Vector3d>& points, int num_threads = 0);

  size_t size() const { return items_.size(); }

  // As they were given.
  std::vector<Eigen::Vector3d> Points() const;

  Neighbour Nearest(const Eigen::Vector3d& query) const;

  // Sorted by distance; all points if there are fewer than k.
  std::vector<Neighbour> Nearest(const Eigen::Vector3d& query, size_t k) const;

  // The point of this cloud nearest to  this_from_queries * query  for every point of another one,
  // by the other's indices; distances in the frame of this cloud. Queries start from the answer
  // of their neighbour, which makes them several times faster than one by one.
  std::vector<Neighbour> NearestOfAll(const PointTree& queries,
                                      const Sim3d& this_from_queries = {},
                                      int num_threads = 0) const;

  // Unit normals of the surface that the points sample, of arbitrary sign: the direction in which
  // the k nearest points, the point itself among them, spread the least. Zero where these span no
  // plane: fewer than three of them, or one or all on a line (to 1e-6 of their spread).
  std::vector<Eigen::Vector3d> Normals(size_t k, int num_threads = 0) const;

 private:
  struct Item {
    Eigen::Vector3d point;
    uint32_t idx;
  };
  struct Node {
    Eigen::Vector3d min;
    Eigen::Vector3d max;
    uint32_t begin;  // of its items
    uint32_t end;
    uint32_t min_idx;

    double SquaredDistance(const Eigen::Vector3d& query) const;
  };
  // A neighbour and where its item lies.
  struct Candidate {
    double squared_distance;
    uint32_t idx;
    uint32_t position;

    bool operator<(const Candidate& other) const {
      return squared_distance < other.squared_distance ||
             (squared_distance == other.squared_distance && idx < other.idx);
    }
  };
  class OneNearest;
  class ManyNearest;

  bool IsLeaf(size_t node) const { return node >= num_inner_; }
  void SetBox(size_t node);
  void Split(size_t node);
  void BuildBelow(size_t node);
  Candidate MakeCandidate(size_t position, const Eigen::Vector3d& query) const;
  template <typename Search>
  void Visit(const Eigen::Vector3d& query, Search& search) const;
  Eigen::Vector3d NormalOf(const std::vector<Candidate>& neighbours) const;

  std::vector<Item> items_;  // by leaf
  std::vector<Node> nodes_;  // node i has the children 2 i + 1 and 2 i + 2
  size_t num_inner_ = 0;
};

}  // namespace vgtw
