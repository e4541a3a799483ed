// SPDX-License-Identifier: BSD-3-Clause
#include "matching/sift_budget.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

namespace vgtw {

std::vector<size_t> SpreadOverImage(const std::vector<ScoredPixel>& points,
                                    const ImageSize& size,
                                    size_t budget) {
  std::vector<size_t> order(points.size());
  std::iota(order.begin(), order.end(), size_t{0});
  if (points.size() <= budget) return order;
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return points[a].score > points[b].score;
  });

  const double num_pixels = static_cast<double>(size.width) * static_cast<double>(size.height);
  const float cell_size = static_cast<float>(std::max(1.0, std::sqrt(num_pixels / kNumCells)));
  std::map<std::pair<int, int>, int> num_in_cell;
  std::vector<int> round(points.size());
  for (const size_t i : order) {
    const Eigen::Vector2f cell = (points[i].pixel / cell_size).array().floor();
    round[i] = num_in_cell[{static_cast<int>(cell.x()), static_cast<int>(cell.y())}]++;
  }
  // Stable: inside a round the best score stays first.
  std::stable_sort(
      order.begin(), order.end(), [&](size_t a, size_t b) { return round[a] < round[b]; });
  order.resize(budget);
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace vgtw
