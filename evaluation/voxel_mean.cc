// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/voxel_mean.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

namespace vgtw {
namespace {

using Cube = std::array<int64_t, 3>;

Cube CubeOf(const Eigen::Vector3d& point, double voxel_size) {
  constexpr double kMaxIndex = 4611686018427387904.0;  // 2^62
  Cube cube;
  for (int axis = 0; axis < 3; ++axis) {
    const double index = std::floor(point[axis] / voxel_size);
    VGTW_CHECK(std::abs(index) <= kMaxIndex, "a point too far away for the voxels' size");
    cube[static_cast<size_t>(axis)] = static_cast<int64_t>(index);
  }
  return cube;
}

}  // namespace

std::vector<Eigen::Vector3d> MeanInVoxels(const std::vector<Eigen::Vector3d>& points,
                                          double voxel_size) {
  VGTW_CHECK(std::isfinite(voxel_size) && voxel_size > 0.0, std::to_string(voxel_size));
  VGTW_CHECK(points.size() <= std::numeric_limits<uint32_t>::max(), std::to_string(points.size()));
  struct Entry {
    Cube cube;
    uint32_t idx;
    auto operator<=>(const Entry&) const = default;
  };
  std::vector<Entry> entries;
  entries.reserve(points.size());
  for (const Eigen::Vector3d& point : points) {
    entries.push_back({CubeOf(point, voxel_size), static_cast<uint32_t>(entries.size())});
  }
  std::sort(entries.begin(), entries.end());
  std::vector<Eigen::Vector3d> means;
  for (size_t first = 0; first < entries.size();) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    size_t end = first;
    for (; end < entries.size() && entries[end].cube == entries[first].cube; ++end) {
      sum += points[entries[end].idx];
    }
    means.push_back(sum / static_cast<double>(end - first));
    first = end;
  }
  return means;
}

}  // namespace vgtw
