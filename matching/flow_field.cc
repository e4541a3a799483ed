// SPDX-License-Identifier: BSD-3-Clause
#include "matching/flow_field.h"

#include "scene/statistics.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace vgtw {
namespace {

constexpr size_t kNumNeighbours = 5;
constexpr size_t kMaxAnchors = 400;
constexpr size_t kMinAnchors = 2 * kNumNeighbours;

float MedianOf(std::array<float, kNumNeighbours>& values, size_t count) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(values.begin(), middle, values.begin() + static_cast<std::ptrdiff_t>(count));
  return *middle;
}

}  // namespace

FlowField::FlowField(std::vector<Anchor> anchors) : anchors_(std::move(anchors)) {
  if (anchors_.size() > kMaxAnchors) {
    std::vector<Anchor> sample;
    for (size_t i = 0; i < kMaxAnchors; ++i) {
      sample.push_back(anchors_[i * anchors_.size() / kMaxAnchors]);
    }
    anchors_ = std::move(sample);
  }
  if (!IsUsable()) return;
  std::vector<double> deviations;
  for (size_t i = 0; i < anchors_.size(); ++i) {
    deviations.push_back((Without(i, anchors_[i].pixel) - anchors_[i].flow).norm());
  }
  radius_ = 3.0f * static_cast<float>(Percentile(std::move(deviations), 95.0));
}

bool FlowField::IsUsable() const { return anchors_.size() >= kMinAnchors; }

Eigen::Vector2f FlowField::At(const Eigen::Vector2f& pixel) const {
  return Without(kNoAnchor, pixel);
}

Eigen::Vector2f FlowField::Without(size_t left_out, const Eigen::Vector2f& pixel) const {
  // Kept sorted by insertion: nearly every anchor fails the first comparison.
  std::array<std::pair<float, size_t>, kNumNeighbours> nearest;
  nearest.fill({std::numeric_limits<float>::infinity(), kNoAnchor});
  for (size_t i = 0; i < anchors_.size(); ++i) {
    const float distance = (anchors_[i].pixel - pixel).squaredNorm();
    if (!(distance < nearest.back().first) || i == left_out) continue;
    nearest.back() = {distance, i};
    for (size_t k = kNumNeighbours - 1; k > 0 && nearest[k].first < nearest[k - 1].first; --k) {
      std::swap(nearest[k], nearest[k - 1]);
    }
  }
  std::array<float, kNumNeighbours> x = {}, y = {};
  size_t count = 0;
  for (const auto& [distance, idx] : nearest) {
    if (idx == kNoAnchor) break;
    x[count] = anchors_[idx].flow.x();
    y[count] = anchors_[idx].flow.y();
    ++count;
  }
  if (count == 0) return Eigen::Vector2f::Zero();
  return {MedianOf(x, count), MedianOf(y, count)};
}

}  // namespace vgtw
