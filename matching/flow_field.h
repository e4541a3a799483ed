// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// A smooth field of vectors over an image, known at some pixels, some of them wrong: at a pixel it
// is the median, per component, of the nearest known ones.
class FlowField {
 public:
  struct Anchor {
    Eigen::Vector2f pixel;
    Eigen::Vector2f flow;
  };

  // Of many anchors an even sample is used, so that At() takes bounded time.
  explicit FlowField(std::vector<Anchor> anchors);

  // Too few anchors say nothing of the field between them.
  bool IsUsable() const;
  Eigen::Vector2f At(const Eigen::Vector2f& pixel) const;

  // How far true vectors lie from the field: three times what 19 of 20 anchors deviate at most from
  // the field of the others. Infinite if the field is not usable.
  float Radius() const { return radius_; }

 private:
  static constexpr size_t kNoAnchor = static_cast<size_t>(-1);
  Eigen::Vector2f Without(size_t left_out, const Eigen::Vector2f& pixel) const;

  std::vector<Anchor> anchors_;  // from left to right
  float radius_ = std::numeric_limits<float>::infinity();
};

}  // namespace vgtw
