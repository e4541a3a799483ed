// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/surface_cloud.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Thins clouds that come part by part: one point per occupied cube of edge `edge` (> 0) of the
// lattice through the origin, half-open: [i, i + 1) * edge. It is the mean of everything that the
// cube's points have; the normal is the direction of their mean. Every point counts the same,
// whatever the parts. Points that are not finite or more than 2^62 cubes away are left out.
class VoxelMeans {
 public:
  explicit VoxelMeans(double edge);

  // All parts have the same lists.
  void Add(const SurfaceCloud& part);

  // Ordered by cube.
  SurfaceCloud Means() const;

 private:
  using Cell = std::array<int64_t, 3>;
  struct CellHash {
    size_t operator()(const Cell& cell) const;
  };
  struct Sums {
    double count = 0.0;
    Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
    Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    std::vector<double> scalars;
  };

  double edge_;
  bool has_normals_ = false;
  std::vector<std::string> scalar_names_;
  std::unordered_map<Cell, Sums, CellHash> sums_by_cell_;
};

}  // namespace vgtw
