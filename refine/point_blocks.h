// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include <Eigen/Core>

namespace vgtw {

// Index of the point whose parameter block this is, or -1. The points are neighbours in memory.
inline std::ptrdiff_t PointIdx(std::span<const Eigen::Vector3d> points, const double* values) {
  const std::less<const double*> before;
  if (points.empty() || before(values, points.front().data()) ||
      before(points.back().data(), values)) {
    return -1;
  }
  return (values - points.front().data()) / 3;
}

}  // namespace vgtw
