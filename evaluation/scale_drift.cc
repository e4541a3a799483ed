// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/scale_drift.h"

#include "scene/statistics.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace vgtw {
namespace {

constexpr size_t kNumNearest = 5;

}  // namespace

std::optional<double> ScaleDriftPercent(const std::map<std::string, Rigid3d>& estimate,
                                        const std::map<std::string, Rigid3d>& reference) {
  std::vector<Eigen::Vector3d> estimated;
  std::vector<Eigen::Vector3d> expected;
  for (const auto& [name, cam_from_world] : reference) {
    const auto found = estimate.find(name);
    if (found == estimate.end()) continue;
    estimated.push_back(OriginInSource(found->second));
    expected.push_back(OriginInSource(cam_from_world));
  }
  std::set<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < expected.size(); ++i) {
    std::vector<std::pair<double, size_t>> others;
    for (size_t k = 0; k < expected.size(); ++k) {
      if (k != i) others.emplace_back((expected[k] - expected[i]).norm(), k);
    }
    const size_t num_nearest = std::min(kNumNearest, others.size());
    std::partial_sort(
        others.begin(), others.begin() + static_cast<std::ptrdiff_t>(num_nearest), others.end());
    for (size_t n = 0; n < num_nearest; ++n) pairs.insert(std::minmax(i, others[n].second));
  }
  std::vector<double> ratios;
  for (const auto& [i, k] : pairs) {
    const double distance = (expected[k] - expected[i]).norm();
    if (distance > 0.0) ratios.push_back((estimated[k] - estimated[i]).norm() / distance);
  }
  if (expected.size() < 3 || ratios.size() < 3) return std::nullopt;
  const double median = Median(ratios);
  if (!(median > 0.0)) return std::nullopt;
  return 50.0 * (Percentile(ratios, 84.0) - Percentile(ratios, 16.0)) / median;
}

}  // namespace vgtw
