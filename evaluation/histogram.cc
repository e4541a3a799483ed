// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/histogram.h"

#include "scene/error.h"

#include <cmath>

namespace vgtw {

Histogram MakeHistogram(const std::vector<double>& values,
                        double first,
                        double step,
                        size_t num_bins) {
  VGTW_CHECK(step > 0.0, "step of a histogram");
  Histogram histogram{first, step, std::vector<size_t>(num_bins, 0)};
  for (const double value : values) {
    const double bin = std::floor((value - first) / step);
    if (bin >= 0.0 && bin < static_cast<double>(num_bins)) {
      ++histogram.counts[static_cast<size_t>(bin)];
    }
  }
  return histogram;
}

}  // namespace vgtw
