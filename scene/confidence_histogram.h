// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace vgtw {

// Percentiles of any number of positive values in 4 MB: one counter per 2^11 steps between powers
// of two, so that a threshold is exact to 0.05 % of its value.
class ConfidenceHistogram {
 public:
  // Values that are not positive count as 0; NaN is left out.
  void Add(float confidence);
  void Add(const ConfidenceHistogram& other);

  size_t count() const { return count_; }

  // The largest threshold of the counters' grid such that at least `percent` of the values are not
  // below it; 0 if there are no values.
  double ThresholdKeeping(double percent) const;

 private:
  std::vector<uint64_t> counters_ = std::vector<uint64_t>(size_t{1} << 19);
  size_t count_ = 0;
};

}  // namespace vgtw
