// SPDX-License-Identifier: BSD-3-Clause
#include "matching/descriptor_distance.h"

#include "scene/error.h"

#include <algorithm>
#include <cstring>
#include <limits>

// Debian builds for the oldest x86-64, where these loops take four times as long, as they do at
// -O2: GCC 12 vectorises loops of unknown length at -O3 alone. The function that chooses at load
// time runs before a sanitizer is ready.
#if defined(__x86_64__) && defined(__linux__) && !defined(__SANITIZE_ADDRESS__)
#define VGTW_FOR_EACH_CPU __attribute__((target_clones("avx2", "default")))
#else
#define VGTW_FOR_EACH_CPU
#endif

namespace vgtw {
namespace {

VGTW_FOR_EACH_CPU int SumOfSquares(const uint8_t* a, const uint8_t* b, size_t n) {
  int sum = 0;
  for (size_t k = 0; k < n; ++k) {
    const int difference = a[k] - b[k];
    sum += difference * difference;
  }
  return sum;
}

// Squares of so many bytes sum up within an int.
constexpr uint32_t kMaxNumBytes = 33000;

bool IsFloat(const Descriptors& descriptors) { return descriptors.type > 0; }

}  // namespace

DescriptorDistance::DescriptorDistance(const Descriptors& descriptors1,
                                       const Descriptors& descriptors2)
    : data1_(descriptors1.data.data()),
      data2_(descriptors2.data.data()),
      num_bytes_(descriptors1.rows > 0 ? descriptors1.cols : descriptors2.cols),
      is_float_(IsFloat(descriptors1.rows > 0 ? descriptors1 : descriptors2)) {
  const int type = (descriptors1.rows > 0 ? descriptors1 : descriptors2).type;
  for (const Descriptors* set : {&descriptors1, &descriptors2}) {
    VGTW_CHECK(set->data.size() == size_t{set->rows} * set->cols, "size of descriptors");
    if (set->rows == 0) continue;
    VGTW_CHECK(set->cols == num_bytes_ && (is_float_ ? set->type == type : !IsFloat(*set)),
               "descriptors of different kinds cannot be compared");
    VGTW_CHECK(!is_float_ || set->cols % sizeof(float) == 0, "float32 descriptors");
    VGTW_CHECK(is_float_ || set->cols <= kMaxNumBytes, "length of descriptors");
  }
}

float DescriptorDistance::OfBytes(const uint8_t* a, const uint8_t* b, size_t num_bytes) {
  return static_cast<float>(SumOfSquares(a, b, num_bytes));
}

float DescriptorDistance::OfFloats(const uint8_t* a, const uint8_t* b, size_t num_bytes) {
  float sum = 0.0f;
  for (size_t k = 0; k < num_bytes; k += sizeof(float)) {
    float x, y;  // blobs need not be aligned
    std::memcpy(&x, a + k, sizeof(float));
    std::memcpy(&y, b + k, sizeof(float));
    sum += (x - y) * (x - y);
  }
  return sum;
}

std::vector<float> BackgroundDistances(const Descriptors& descriptors,
                                       const std::vector<Eigen::Vector2f>& pixels,
                                       size_t num_samples,
                                       float min_distance_px) {
  VGTW_CHECK(descriptors.rows == pixels.size(), "a pixel per descriptor");
  const DescriptorDistance distance(descriptors, descriptors);
  const size_t stride = std::max<size_t>(1, descriptors.rows / std::max<size_t>(1, num_samples));
  std::vector<float> nearest(descriptors.rows, std::numeric_limits<float>::infinity());
  for (size_t i = 0; i < nearest.size(); ++i) {
    for (size_t j = stride / 2; j < nearest.size(); j += stride) {
      if ((pixels[i] - pixels[j]).squaredNorm() < min_distance_px * min_distance_px) continue;
      nearest[i] = std::min(nearest[i], distance(i, j));
    }
  }
  return nearest;
}

}  // namespace vgtw
