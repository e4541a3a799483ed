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
constexpr float kFar = std::numeric_limits<float>::infinity();

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
  std::stable_sort(anchors_.begin(), anchors_.end(), [](const Anchor& a, const Anchor& b) {
    return a.pixel.x() < b.pixel.x();
  });
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
  std::array<std::pair<float, size_t>, kNumNeighbours> nearest;  // kept sorted by insertion
  nearest.fill({kFar, kNoAnchor});
  // Whether anchors farther on may be near enough: their column is at least as far as that of `i`.
  const auto visit = [&](size_t i) {
    const Eigen::Vector2f offset = anchors_[i].pixel - pixel;
    if (!(offset.x() * offset.x() < nearest.back().first)) return false;
    const float distance = offset.squaredNorm();
    if (!(distance < nearest.back().first) || i == left_out) return true;
    nearest.back() = {distance, i};
    for (size_t k = kNumNeighbours - 1; k > 0 && nearest[k].first < nearest[k - 1].first; --k) {
      std::swap(nearest[k], nearest[k - 1]);
    }
    return true;
  };
  const auto at_right = std::lower_bound(
      anchors_.begin(), anchors_.end(), pixel.x(), [](const Anchor& anchor, float x) {
        return anchor.pixel.x() < x;
      });
  const auto middle = static_cast<size_t>(at_right - anchors_.begin());
  for (size_t i = middle; i < anchors_.size() && visit(i); ++i) continue;
  for (size_t i = middle; i > 0 && visit(i - 1); --i) continue;
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
