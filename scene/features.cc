// SPDX-License-Identifier: BSD-3-Clause
#include "scene/features.h"

#include <cmath>

namespace vgtw {

float KeypointScale(const float* row, uint32_t cols) {
  if (cols == 2) return 0.0f;
  if (cols == 4) return row[2];
  return 0.5f * (std::hypot(row[2], row[4]) + std::hypot(row[3], row[5]));
}

}  // namespace vgtw
