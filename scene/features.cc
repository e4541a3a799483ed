// SPDX-License-Identifier: BSD-3-Clause
#include "scene/features.h"

#include <cmath>

namespace vgtw {

float Keypoints::Scale(size_t row) const {
  if (cols == 2) return 0.0f;
  const float* values = data.data() + row * cols;
  if (cols == 4) return values[2];
  return 0.5f * (std::hypot(values[2], values[4]) + std::hypot(values[3], values[5]));
}

}  // namespace vgtw
