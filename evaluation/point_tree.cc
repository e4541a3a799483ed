// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/point_tree.h"

#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <utility>

#include <Eigen/Eigenvalues>

namespace vgtw {
namespace {

constexpr size_t kMaxLeafSize = 12;
// Subtrees that are built, and neighbours that are looked for, as one piece of a thread's work.
constexpr size_t kNumBuildTasks = 64;
constexpr size_t kNumQueriesPerTask = 4096;

// Of the larger spreads; with less the points lie on a line up to rounding.
constexpr double kMinRelativeSpread = 1e-6;

}  // namespace

inline double PointTree::Node::SquaredDistance(const Eigen::Vector3d& query) const {
  return (min - query).cwiseMax(query - max).cwiseMax(0.0).squaredNorm();
}

inline PointTree::Candidate PointTree::MakeCandidate(size_t position,
                                                     const Eigen::Vector3d& query) const {
  const Item& item = items_[position];
  return {(item.point - query).squaredNorm(), item.idx, static_cast<uint32_t>(position)};
}

PointTree::PointTree(const std::vector<Eigen::Vector3d>& points, int num_threads) {
  VGTW_CHECK(!points.empty(), "a cloud without points");
  VGTW_CHECK(points.size() < std::numeric_limits<uint32_t>::max(), std::to_string(points.size()));
  items_.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    VGTW_CHECK(point.allFinite(), "a point that is not finite");
    items_.push_back({point, static_cast<uint32_t>(items_.size())});
  }
  size_t num_leaves = 1;
  while (num_leaves * kMaxLeafSize < items_.size()) num_leaves *= 2;
  num_inner_ = num_leaves - 1;
  nodes_.resize(num_inner_ + num_leaves);
  nodes_[0].begin = 0;
  nodes_[0].end = static_cast<uint32_t>(items_.size());
  size_t first = 0;  // node of the level whose nodes are built below as one piece each
  for (; first < num_inner_ && first + 1 < kNumBuildTasks; first = 2 * first + 1) {
    ParallelFor(static_cast<int64_t>(first + 1), num_threads, [&](int64_t i) {
      SetBox(first + static_cast<size_t>(i));
      Split(first + static_cast<size_t>(i));
    });
  }
  ParallelFor(static_cast<int64_t>(first + 1), num_threads, [&](int64_t i) {
    BuildBelow(first + static_cast<size_t>(i));
  });
}

std::vector<Eigen::Vector3d> PointTree::Points() const {
  std::vector<Eigen::Vector3d> points(size());
  for (const Item& item : items_) points[item.idx] = item.point;
  return points;
}

void PointTree::SetBox(size_t node_idx) {
  Node& node = nodes_[node_idx];
  node.min.setConstant(std::numeric_limits<double>::infinity());
  node.max = -node.min;
  node.min_idx = std::numeric_limits<uint32_t>::max();
  for (size_t i = node.begin; i < node.end; ++i) {
    node.min = node.min.cwiseMin(items_[i].point);
    node.max = node.max.cwiseMax(items_[i].point);
    node.min_idx = std::min(node.min_idx, items_[i].idx);
  }
}

// At the median of the longest side of the box.
void PointTree::Split(size_t node_idx) {
  const Node& node = nodes_[node_idx];
  int axis = 0;
  (node.max - node.min).maxCoeff(&axis);
  const uint32_t middle = node.begin + (node.end - node.begin) / 2;
  std::nth_element(items_.begin() + node.begin,
                   items_.begin() + middle,
                   items_.begin() + node.end,
                   [axis](const Item& a, const Item& b) { return a.point[axis] < b.point[axis]; });
  Node& left = nodes_[2 * node_idx + 1];
  Node& right = nodes_[2 * node_idx + 2];
  left.begin = node.begin;
  left.end = right.begin = middle;
  right.end = node.end;
}

void PointTree::BuildBelow(size_t node_idx) {
  SetBox(node_idx);
  if (IsLeaf(node_idx)) return;
  Split(node_idx);
  BuildBelow(2 * node_idx + 1);
  BuildBelow(2 * node_idx + 2);
}

// Offers to `search` every point that may be better than search.Bound(), nearer ones first.
// Rounding is monotone, so that no computed distance is less than that of the box around it.
template <typename Search>
void PointTree::Visit(const Eigen::Vector3d& query, Search& search) const {
  constexpr size_t kMaxDepth = 33;
  std::array<Candidate, kMaxDepth> pending;  // `position` is the node
  const auto best_possible = [&](size_t node) {
    return Candidate{
        nodes_[node].SquaredDistance(query), nodes_[node].min_idx, static_cast<uint32_t>(node)};
  };
  size_t num_pending = 0;
  pending[num_pending++] = best_possible(0);
  while (num_pending > 0) {
    Candidate node = pending[--num_pending];
    while (node < search.Bound() && !IsLeaf(node.position)) {
      Candidate near = best_possible(2 * size_t{node.position} + 1);
      Candidate far = best_possible(2 * size_t{node.position} + 2);
      if (far < near) std::swap(near, far);
      if (far < search.Bound()) pending[num_pending++] = far;
      node = near;
    }
    if (!(node < search.Bound())) continue;
    for (size_t i = nodes_[node.position].begin; i < nodes_[node.position].end; ++i) {
      const Candidate candidate = MakeCandidate(i, query);
      if (candidate < search.Bound()) search.Add(candidate);
    }
  }
}

class PointTree::OneNearest {
 public:
  void StartFrom(const Candidate& candidate) { best_ = candidate; }
  const Candidate& Bound() const { return best_; }
  void Add(const Candidate& candidate) { best_ = candidate; }

 private:
  Candidate best_ = {
      std::numeric_limits<double>::infinity(), std::numeric_limits<uint32_t>::max(), 0};
};

// Collects more than k before it looks for the k best: a heap would sort what need not be sorted.
class PointTree::ManyNearest {
 public:
  explicit ManyNearest(size_t k) : k_(k) { Clear(); }

  void Clear() {
    found_.clear();
    bound_ = {std::numeric_limits<double>::infinity(), std::numeric_limits<uint32_t>::max(), 0};
  }

  // Begins anew, knowing that k points are not worse than `worst`.
  void StartFrom(const Candidate& worst) {
    found_.clear();
    bound_ = {worst.squared_distance, worst.idx + 1, 0};
  }

  const Candidate& Bound() const { return bound_; }

  void Add(const Candidate& candidate) {
    found_.push_back(candidate);
    if (found_.size() >= 2 * k_) KeepBest();
  }

  void KeepBest() {
    if (found_.size() <= k_) return;
    const auto last = found_.begin() + static_cast<std::ptrdiff_t>(k_ - 1);
    std::nth_element(found_.begin(), last, found_.end());
    bound_ = *last;
    found_.resize(k_);
  }

  const std::vector<Candidate>& found() const { return found_; }

 private:
  size_t k_;
  std::vector<Candidate> found_;
  Candidate bound_{};  // candidates must be less
};

Neighbour PointTree::Nearest(const Eigen::Vector3d& query) const {
  OneNearest search;
  Visit(query, search);
  return {search.Bound().squared_distance, search.Bound().idx};
}

std::vector<Neighbour> PointTree::Nearest(const Eigen::Vector3d& query, size_t k) const {
  VGTW_CHECK(k > 0, "no neighbour asked for");
  ManyNearest search(k);
  Visit(query, search);
  search.KeepBest();
  std::vector<Neighbour> neighbours;
  for (const Candidate& found : search.found()) {
    neighbours.push_back({found.squared_distance, found.idx});
  }
  std::sort(neighbours.begin(), neighbours.end());
  return neighbours;
}

std::vector<Neighbour> PointTree::NearestOfAll(const PointTree& queries,
                                               const Sim3d& this_from_queries,
                                               int num_threads) const {
  std::vector<Neighbour> neighbours(queries.size());
  const size_t num_tasks = (queries.size() + kNumQueriesPerTask - 1) / kNumQueriesPerTask;
  ParallelFor(static_cast<int64_t>(num_tasks), num_threads, [&](int64_t task) {
    const size_t begin = static_cast<size_t>(task) * kNumQueriesPerTask;
    const size_t end = std::min(begin + kNumQueriesPerTask, queries.size());
    OneNearest search;
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d query = this_from_queries * queries.items_[i].point;
      if (i > begin) search.StartFrom(MakeCandidate(search.Bound().position, query));
      Visit(query, search);
      neighbours[queries.items_[i].idx] = {search.Bound().squared_distance, search.Bound().idx};
    }
  });
  return neighbours;
}

Eigen::Vector3d PointTree::NormalOf(const std::vector<Candidate>& neighbours) const {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Candidate& neighbour : neighbours) mean += items_[neighbour.position].point;
  mean /= static_cast<double>(neighbours.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Candidate& neighbour : neighbours) {
    const Eigen::Vector3d offset = items_[neighbour.position].point - mean;
    covariance += offset * offset.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Eigen::Vector3d& squared_spreads = solver.eigenvalues();  // increasing
  constexpr double kMinRatio = kMinRelativeSpread * kMinRelativeSpread;
  if (!(squared_spreads[1] > kMinRatio * squared_spreads[2])) return Eigen::Vector3d::Zero();
  return solver.eigenvectors().col(0);
}

std::vector<Eigen::Vector3d> PointTree::Normals(size_t k, int num_threads) const {
  VGTW_CHECK(k > 0, "normals from no neighbours");
  std::vector<Eigen::Vector3d> normals(size());
  const size_t num_tasks = (size() + kNumQueriesPerTask - 1) / kNumQueriesPerTask;
  ParallelFor(static_cast<int64_t>(num_tasks), num_threads, [&](int64_t task) {
    const size_t begin = static_cast<size_t>(task) * kNumQueriesPerTask;
    const size_t end = std::min(begin + kNumQueriesPerTask, size());
    ManyNearest search(k);
    for (size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d& query = items_[i].point;
      if (search.found().size() == k) {
        Candidate worst = MakeCandidate(search.found()[0].position, query);
        for (const Candidate& found : search.found()) {
          const Candidate candidate = MakeCandidate(found.position, query);
          if (worst < candidate) worst = candidate;
        }
        search.StartFrom(worst);
      } else {
        search.Clear();
      }
      Visit(query, search);
      search.KeepBest();
      normals[items_[i].idx] = NormalOf(search.found());
    }
  });
  return normals;
}

}  // namespace vgtw
