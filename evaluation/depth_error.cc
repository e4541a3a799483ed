// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/depth_error.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace vgtw {
namespace {

double FitScale(const DepthPairs& pairs) {
  constexpr int kNumSteps = 10;
  constexpr double kMinRelativeResidual = 1e-8;  // of the mean depth
  const auto& [predicted, expected] = pairs;
  const double sum_expected = std::accumulate(expected.begin(), expected.end(), 0.0);
  const double min_residual =
      kMinRelativeResidual * sum_expected / static_cast<double>(expected.size());
  double scale = sum_expected / std::accumulate(predicted.begin(), predicted.end(), 0.0);
  for (int step = 0; step < kNumSteps; ++step) {
    double numerator = 0.0;
    double denominator = 0.0;
    for (size_t i = 0; i < predicted.size(); ++i) {
      const double residual = std::abs(scale * predicted[i] - expected[i]);
      const double weight = 1.0 / (residual + min_residual);
      numerator += weight * predicted[i] * expected[i];
      denominator += weight * predicted[i] * predicted[i];
    }
    scale = numerator / denominator;
  }
  return scale;
}

// The best line through one of the points, and another point on it.
struct LineThroughPoint {
  double scale = 0.0;
  double cost = std::numeric_limits<double>::infinity();  // sum of absolute differences
  size_t other_idx = 0;
};

struct Slope {
  double value;
  double weight;
  size_t idx;
};

// With the point fixed the cost is sum_i weight_i |scale - slope_i|: a weighted median.
LineThroughPoint FitLineThrough(const DepthPairs& pairs, size_t idx, std::vector<Slope>& slopes) {
  const auto& [predicted, expected] = pairs;
  slopes.clear();
  LineThroughPoint line;
  double sum_weights = 0.0;
  for (size_t i = 0; i < predicted.size(); ++i) {
    const double run = predicted[i] - predicted[idx];
    if (run == 0.0) continue;
    slopes.push_back({(expected[i] - expected[idx]) / run, std::abs(run), i});
    sum_weights += std::abs(run);
  }
  std::sort(slopes.begin(), slopes.end(), [](const Slope& a, const Slope& b) {
    return a.value < b.value || (a.value == b.value && a.idx < b.idx);
  });
  double sum_below = 0.0;
  for (const Slope& slope : slopes) {
    sum_below += slope.weight;
    if (2.0 * sum_below < sum_weights) continue;
    line.scale = slope.value;
    line.other_idx = slope.idx;
    break;
  }
  line.cost = 0.0;
  for (size_t i = 0; i < predicted.size(); ++i) {
    line.cost +=
        std::abs(line.scale * (predicted[i] - predicted[idx]) + expected[idx] - expected[i]);
  }
  return line;
}

std::optional<DepthFit> FitScaleShift(const DepthPairs& pairs) {
  const auto [min, max] = std::minmax_element(pairs.predicted.begin(), pairs.predicted.end());
  if (*min == *max) return std::nullopt;
  std::vector<Slope> slopes;
  size_t anchor = 0;
  LineThroughPoint best = FitLineThrough(pairs, anchor, slopes);
  while (true) {
    // Where the cost no longer falls, the line is the best through both of its points.
    const LineThroughPoint next = FitLineThrough(pairs, best.other_idx, slopes);
    if (!(next.cost < best.cost)) break;
    anchor = best.other_idx;
    best = next;
  }
  return DepthFit{best.scale, pairs.expected[anchor] - best.scale * pairs.predicted[anchor]};
}

}  // namespace

std::optional<DepthFit> FitDepth(const DepthPairs& pairs, DepthAlignment alignment) {
  VGTW_CHECK(pairs.predicted.size() == pairs.expected.size(), "depths come in pairs");
  if (pairs.predicted.empty()) return std::nullopt;
  switch (alignment) {
    case DepthAlignment::kNone:
      return DepthFit{};
    case DepthAlignment::kMedian:
      return DepthFit{Median(pairs.expected) / Median(pairs.predicted), 0.0};
    case DepthAlignment::kScale:
      return DepthFit{FitScale(pairs), 0.0};
    case DepthAlignment::kScaleShift:
      return FitScaleShift(pairs);
  }
  return std::nullopt;
}

double DepthError::AbsRel() const { return sum_abs_rel / static_cast<double>(num_pixels); }

double DepthError::WithinPercent() const {
  return 100.0 * static_cast<double>(num_within) / static_cast<double>(num_pixels);
}

DepthError& DepthError::operator+=(const DepthError& other) {
  num_pixels += other.num_pixels;
  sum_abs_rel += other.sum_abs_rel;
  num_within += other.num_within;
  return *this;
}

DepthError CompareDepths(const DepthPairs& pairs, const DepthFit& fit) {
  VGTW_CHECK(pairs.predicted.size() == pairs.expected.size(), "depths come in pairs");
  constexpr double kMaxRatio = 1.25;
  DepthError error;
  for (size_t i = 0; i < pairs.predicted.size(); ++i) {
    const double aligned = fit.scale * pairs.predicted[i] + fit.shift;
    const double expected = pairs.expected[i];
    error.sum_abs_rel += std::abs(aligned - expected) / expected;
    error.num_within +=
        aligned > 0.0 && std::max(aligned / expected, expected / aligned) < kMaxRatio;
  }
  error.num_pixels = pairs.predicted.size();
  return error;
}

}  // namespace vgtw
