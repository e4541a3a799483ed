// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace vgtw {

// counts[i] values lie in [first + i * step, first + (i + 1) * step); others are left out.
struct Histogram {
  double first = 0.0;
  double step = 1.0;
  std::vector<size_t> counts;
};

// Throws std::invalid_argument unless step > 0.
Histogram MakeHistogram(const std::vector<double>& values,
                        double first,
                        double step,
                        size_t num_bins);

}  // namespace vgtw
