// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Value below which `percent` of the values lie, linear between neighbours in sorted order (0 gives
// the smallest, 100 the largest). Throws std::invalid_argument if `values` is empty or `percent` is
// outside [0, 100].
double Percentile(std::vector<double> values, double percent);

// The middle value, or the mean of the two middle values.
double Median(std::vector<double> values);

// Largest distance between two of the points, 0 with fewer than two: of camera centres, the unit of
// "% of the extent". Time grows with the square of their number.
double Diameter(const std::vector<Eigen::Vector3d>& points);

}  // namespace vgtw
