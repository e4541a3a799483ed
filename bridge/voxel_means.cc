// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/voxel_means.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

constexpr double kMaxCell = 4611686018427387904.0;  // 2^62

}  // namespace

VoxelMeans::VoxelMeans(double edge) : edge_(edge) {
  VGTW_CHECK(edge > 0.0 && std::isfinite(edge), "an edge of " + std::to_string(edge));
}

size_t VoxelMeans::CellHash::operator()(const Cell& cell) const {
  uint64_t hash = 0;
  for (const int64_t i : cell) {
    // Odd, its bits at random: 2^64 over the golden ratio.
    hash = (hash ^ static_cast<uint64_t>(i)) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 32;
  }
  return hash;
}

void VoxelMeans::Add(const SurfaceCloud& part) {
  if (sums_by_cell_.empty()) {
    has_normals_ = !part.normals.empty();
    scalar_names_.clear();
    for (const CloudScalar& scalar : part.scalars) scalar_names_.push_back(scalar.name);
  }
  VGTW_CHECK(part.points.empty() || has_normals_ == !part.normals.empty(), "other lists");
  VGTW_CHECK(part.scalars.size() == scalar_names_.size(), "other scalars");
  for (size_t i = 0; i < part.points.size(); ++i) {
    const Eigen::Vector3d xyz = part.points[i].xyz.cast<double>();
    const Eigen::Array3d cell = (xyz / edge_).array().floor();
    if (!(cell.abs() < kMaxCell).all()) continue;
    Sums& sums = sums_by_cell_[{static_cast<int64_t>(cell.x()),
                                static_cast<int64_t>(cell.y()),
                                static_cast<int64_t>(cell.z())}];
    sums.scalars.resize(scalar_names_.size());
    ++sums.count;
    sums.xyz += xyz;
    for (int k = 0; k < 3; ++k) sums.rgb[k] += part.points[i].rgb[static_cast<size_t>(k)];
    if (has_normals_) sums.normal += part.normals[i].cast<double>();
    for (size_t k = 0; k < sums.scalars.size(); ++k) sums.scalars[k] += part.scalars[k].values[i];
  }
}

SurfaceCloud VoxelMeans::Means() const {
  std::vector<Cell> cells;
  cells.reserve(sums_by_cell_.size());
  for (const auto& [cell, sums] : sums_by_cell_) cells.push_back(cell);
  std::sort(cells.begin(), cells.end());
  SurfaceCloud cloud;
  for (const std::string& name : scalar_names_) cloud.scalars.push_back({name, {}});
  for (const Cell& cell : cells) {
    const Sums& sums = sums_by_cell_.at(cell);
    ColoredPoint& point = cloud.points.emplace_back();
    point.xyz = (sums.xyz / sums.count).cast<float>();
    for (int k = 0; k < 3; ++k) {
      point.rgb[static_cast<size_t>(k)] =
          static_cast<uint8_t>(std::lround(sums.rgb[k] / sums.count));
    }
    if (has_normals_) cloud.normals.push_back(sums.normal.normalized().cast<float>());
    for (size_t k = 0; k < sums.scalars.size(); ++k) {
      cloud.scalars[k].values.push_back(static_cast<float>(sums.scalars[k] / sums.count));
    }
  }
  return cloud;
}

}  // namespace vgtw
