// SPDX-License-Identifier: BSD-3-Clause
#include "scene/statistics.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace vgtw {

double Percentile(std::vector<double> values, double percent) {
  VGTW_CHECK(!values.empty(), "no values");
  VGTW_CHECK(percent >= 0.0 && percent <= 100.0, std::to_string(percent));
  const double rank = percent / 100.0 * static_cast<double>(values.size() - 1);
  const auto lower = values.begin() + static_cast<std::ptrdiff_t>(std::floor(rank));
  std::nth_element(values.begin(), lower, values.end());
  const double share = rank - std::floor(rank);
  if (share == 0.0) return *lower;
  const double upper = *std::min_element(lower + 1, values.end());
  return *lower + share * (upper - *lower);
}

double Median(std::vector<double> values) { return Percentile(std::move(values), 50.0); }

double Diameter(const std::vector<Eigen::Vector3d>& points) {
  double squared = 0.0;
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t j = i + 1; j < points.size(); ++j) {
      squared = std::max(squared, (points[i] - points[j]).squaredNorm());
    }
  }
  return std::sqrt(squared);
}

}  // namespace vgtw
