// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tests/evaluation/golden_cases.h"

#include <cmath>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

using Points = std::vector<Eigen::Vector3d>;

inline double Fraction(double value) { return value - std::floor(value); }

// made_cloud() of golden/cloud_error.py, the same bit by bit.
inline Points MadeCloud(int count, double shift, double roughness) {
  Points points;
  for (int i = 0; i < count; ++i) {
    const double idx = i + 1 + shift;
    const double u = Fraction(idx * 0.8191725134);
    const double v = Fraction(idx * 0.6710436067);
    const double w = Fraction(idx * 0.5497004779);
    const double x = 6.0 * u - 3.0;
    const double y = 6.0 * v - 3.0;
    const double z = 0.1 * x * x - 0.2 * x * y + roughness * (w - 0.5);
    points.push_back({x, y, i % 50 == 49 ? 3.0 * w : z});
  }
  return points;
}

inline Points MadePrediction() { return MadeCloud(3000, 0.25, 0.06); }

inline Points MadeReference() {
  Points points = MadeCloud(4000, 7.75, 0.02);
  std::erase_if(points, [](const Eigen::Vector3d& point) { return !(point.x() > -2.5); });
  return points;
}

}  // namespace vgtw
