// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/features.h"

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Squared Euclidean distance between descriptors:  sum_k (a_k - b_k)^2.
// SIFT and undefined types are bytes, all others little-endian float32 (COLMAP 4's ALIKED).
class DescriptorDistance {
 public:
  // Both sets must outlive it. Throws std::invalid_argument if types or lengths disagree (SIFT and
  // undefined agree), floats are cut off, or bytes are more than 33,000. An empty set goes with
  // every other.
  DescriptorDistance(const Descriptors& descriptors1, const Descriptors& descriptors2);

  float operator()(size_t idx1, size_t idx2) const {
    const uint8_t* a = data1_ + idx1 * num_bytes_;
    const uint8_t* b = data2_ + idx2 * num_bytes_;
    return is_float_ ? OfFloats(a, b, num_bytes_) : OfBytes(a, b, num_bytes_);
  }

 private:
  static float OfBytes(const uint8_t* a, const uint8_t* b, size_t num_bytes);
  static float OfFloats(const uint8_t* a, const uint8_t* b, size_t num_bytes);

  const uint8_t* data1_;
  const uint8_t* data2_;
  size_t num_bytes_ = 0;  // per descriptor
  bool is_float_ = false;
};

// Per descriptor the squared distance to the nearest of a sample of its own set: how near something
// else that looks alike is, and so what a true match has to beat. Every `num_samples`-th part of
// the set gives one sample; those nearer than `min_distance_px` to the keypoint show the same
// texture and do not count. Infinite where no sample counts.
std::vector<float> BackgroundDistances(const Descriptors& descriptors,
                                       const std::vector<Eigen::Vector2f>& pixels,
                                       size_t num_samples,
                                       float min_distance_px);

}  // namespace vgtw
