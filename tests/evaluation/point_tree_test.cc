// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/point_tree.h"

#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Points = std::vector<Eigen::Vector3d>;

Points RandomPoints(size_t n, uint64_t seed) {
  RandomStream random(HashKey({seed}));
  Points points;
  for (size_t i = 0; i < n; ++i) points.push_back(random.NormalVector());
  return points;
}

// Clouds in which much is equally near.
Points Degenerate(const std::string& kind, size_t n) {
  RandomStream random(HashKey({7}));
  Points points;
  for (size_t i = 0; i < n; ++i) {
    if (kind == "equal") points.push_back({1.0, 2.0, 3.0});
    if (kind == "few places") points.push_back(Eigen::Vector3d(i % 3, i % 2, 0.0));
    if (kind == "collinear") points.push_back(random.Uniform() * Eigen::Vector3d(1.0, 2.0, -1.0));
    if (kind == "planar") points.push_back({random.Normal(), random.Normal(), 0.5});
    if (kind == "lattice") points.push_back(Eigen::Vector3d(i % 7, (i / 7) % 7, i / 49));
    if (kind == "far apart")
      points.push_back(std::pow(10.0, double(i % 30)) * random.NormalVector());
  }
  return points;
}

std::vector<Neighbour> ByExhaustion(const Points& points, const Eigen::Vector3d& query, size_t k) {
  std::vector<Neighbour> all;
  for (const Eigen::Vector3d& point : points) {
    all.push_back({(point - query).squaredNorm(), static_cast<uint32_t>(all.size())});
  }
  std::sort(all.begin(), all.end());
  all.resize(std::min(k, all.size()));
  return all;
}

void ExpectExhaustive(const Points& points, const Points& queries) {
  const PointTree tree(points, 2);
  for (const Eigen::Vector3d& query : queries) {
    for (const size_t k : {size_t{1}, size_t{5}, size_t{30}}) {
      EXPECT_EQ(tree.Nearest(query, k), ByExhaustion(points, query, k));
    }
    EXPECT_EQ(tree.Nearest(query), ByExhaustion(points, query, 1)[0]);
  }
  const std::vector<Neighbour> nearest = tree.NearestOfAll(PointTree(queries), {}, 2);
  for (size_t i = 0; i < queries.size(); ++i) EXPECT_EQ(nearest[i], tree.Nearest(queries[i]));
}

TEST(PointTree, EqualsAnExhaustiveSearch) {
  for (const size_t n : {1, 2, 11, 12, 13, 24, 25, 1000}) {
    SCOPED_TRACE(n);
    ExpectExhaustive(RandomPoints(n, n), RandomPoints(50, 99));
  }
}

TEST(PointTree, EqualsAnExhaustiveSearchAmongEquallyNearPoints) {
  for (const char* kind : {"equal", "few places", "collinear", "planar", "lattice", "far apart"}) {
    SCOPED_TRACE(kind);
    const Points points = Degenerate(kind, 343);
    Points queries(points.begin(), points.begin() + 60);
    for (const Eigen::Vector3d& query : RandomPoints(20, 5)) queries.push_back(query);
    queries.push_back({3.5, 2.5, 1.5});
    ExpectExhaustive(points, queries);
  }
}

TEST(PointTree, ManyEqualPointsTakeNoQuadraticTime) {
  // 2e5 points, each with 2e5 equally near ones: 4e10 pairs would take minutes.
  const PointTree tree(Points(200000, Eigen::Vector3d(1.0, 1.0, 1.0)));
  EXPECT_EQ(tree.Nearest({0.0, 1.0, 1.0}, 3),
            (std::vector<Neighbour>{{1.0, 0}, {1.0, 1}, {1.0, 2}}));
  for (const Neighbour& neighbour : tree.NearestOfAll(tree)) EXPECT_EQ(neighbour.idx, 0u);
  for (const Eigen::Vector3d& normal : tree.Normals(30)) EXPECT_EQ(normal.norm(), 0.0);
}

TEST(PointTree, QueriesAreMovedIntoItsFrame) {
  const Points points = RandomPoints(500, 1);
  const Sim3d motion = {2.0, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.0, -2.0, 3.0}};
  Points queries;
  for (const Eigen::Vector3d& point : points) queries.push_back(Inverse(motion) * point);
  const auto nearest = PointTree(points).NearestOfAll(PointTree(queries), motion);
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(nearest[i].idx, i);
    EXPECT_LT(nearest[i].squared_distance, 1e-28);  // rounding of coordinates of about 10
  }
}

TEST(PointTree, NormalsOfAPlaneAreItsNormal) {
  const Eigen::Vector3d normal = Eigen::Vector3d(1.0, 2.0, -2.0) / 3.0;
  Points points = RandomPoints(300, 2);
  for (Eigen::Vector3d& point : points) point -= normal.dot(point) * normal;
  for (const Eigen::Vector3d& found : PointTree(points).Normals(30)) {
    // Rounding of coordinates over a neighbourhood of about a tenth of their size.
    EXPECT_NEAR(std::abs(found.dot(normal)), 1.0, 1e-12);
  }
}

TEST(PointTree, NormalsAreThoseOfTheNearestPointsFoundExhaustively) {
  const Points points = RandomPoints(400, 3);
  const std::vector<Eigen::Vector3d> normals = PointTree(points).Normals(10);
  for (size_t i = 0; i < points.size(); i += 7) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    const auto nearest = ByExhaustion(points, points[i], 10);
    for (const Neighbour& neighbour : nearest) mean += points[neighbour.idx] / 10.0;
    // No direction has a smaller spread than the normal.
    const auto spread = [&](const Eigen::Vector3d& direction) {
      double sum = 0.0;
      for (const Neighbour& neighbour : nearest) {
        sum += std::pow(direction.dot(points[neighbour.idx] - mean), 2);
      }
      return sum;
    };
    EXPECT_NEAR(normals[i].norm(), 1.0, 1e-12);
    RandomStream random(HashKey({i}));
    for (int k = 0; k < 20; ++k) {
      const Eigen::Vector3d nearby = (normals[i] + 0.1 * random.NormalVector()).normalized();
      EXPECT_LE(spread(normals[i]), spread(nearby) * (1.0 + 1e-12));
    }
  }
}

TEST(PointTree, WhatSpansNoPlaneHasNoNormal) {
  for (const char* kind : {"equal", "collinear"}) {
    for (const Eigen::Vector3d& normal : PointTree(Degenerate(kind, 100)).Normals(30)) {
      EXPECT_EQ(normal, Eigen::Vector3d(Eigen::Vector3d::Zero())) << kind;
    }
  }
  for (const Eigen::Vector3d& normal : PointTree(RandomPoints(2, 4)).Normals(30)) {
    EXPECT_EQ(normal.norm(), 0.0);
  }
}

TEST(PointTree, NumberOfThreadsChangesNothing) {
  const Points points = RandomPoints(20000, 5);
  const PointTree queries(RandomPoints(20000, 6));
  const PointTree one(points, 1);
  const PointTree three(points, 3);
  EXPECT_EQ(one.NearestOfAll(queries, {}, 1), three.NearestOfAll(queries, {}, 3));
  EXPECT_EQ(one.Normals(30, 1), three.Normals(30, 3));
  EXPECT_EQ(one.Points(), points);
}

TEST(PointTree, RefusesNoPointsAndPointsThatAreNotFinite) {
  EXPECT_THROW(PointTree({}), std::invalid_argument);
  EXPECT_THROW(PointTree({{0.0, std::numeric_limits<double>::quiet_NaN(), 0.0}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
