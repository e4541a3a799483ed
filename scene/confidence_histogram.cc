// SPDX-License-Identifier: BSD-3-Clause
#include "scene/confidence_histogram.h"

#include <bit>
#include <cmath>

namespace vgtw {
namespace {

// The bits of positive floats are in the order of their values.
constexpr int kDroppedBits = 12;

}  // namespace

void ConfidenceHistogram::Add(float confidence) {
  if (std::isnan(confidence)) return;
  const float positive = confidence > 0.0f ? confidence : 0.0f;
  ++counters_[std::bit_cast<uint32_t>(positive) >> kDroppedBits];
  ++count_;
}

void ConfidenceHistogram::Add(const ConfidenceHistogram& other) {
  for (size_t i = 0; i < counters_.size(); ++i) counters_[i] += other.counters_[i];
  count_ += other.count_;
}

double ConfidenceHistogram::ThresholdKeeping(double percent) const {
  const double wanted = percent / 100.0 * static_cast<double>(count_);
  uint64_t kept = 0;
  for (size_t i = counters_.size(); i-- > 1;) {
    kept += counters_[i];
    if (kept > 0 && static_cast<double>(kept) >= wanted) {
      return std::bit_cast<float>(static_cast<uint32_t>(i) << kDroppedBits);
    }
  }
  return 0.0;
}

}  // namespace vgtw
