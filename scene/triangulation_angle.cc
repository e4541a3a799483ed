// SPDX-License-Identifier: BSD-3-Clause
#include "scene/triangulation_angle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include <Eigen/Geometry>

namespace vgtw {

double TriangulationAngleDeg(std::span<const Eigen::Vector3d> centres,
                             const Eigen::Vector3d& point,
                             double enough_deg) {
  double largest_rad = 0.0;
  const double enough_rad = enough_deg * std::numbers::pi / 180.0;
  for (size_t i = 0; i < centres.size(); ++i) {
    const Eigen::Vector3d a = point - centres[i];
    for (size_t k = 0; k < i; ++k) {
      const Eigen::Vector3d b = point - centres[k];
      largest_rad = std::max(largest_rad, std::atan2(a.cross(b).norm(), a.dot(b)));
      if (largest_rad >= enough_rad) return enough_deg;
    }
  }
  return largest_rad * 180.0 / std::numbers::pi;
}

}  // namespace vgtw
