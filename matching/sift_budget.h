// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct ScoredPixel {
  Eigen::Vector2f pixel;
  float score = 0.0f;
};

// Which of `points` to keep where only `budget` may be kept: the indices, ascending. The image is
// cut into about kNumCells square cells; every cell gives its best, then every cell its second,
// and so on, in the last round those with the highest score. Equal scores: the earlier.
inline constexpr int kNumCells = 256;
std::vector<size_t> SpreadOverImage(const std::vector<ScoredPixel>& points,
                                    const ImageSize& size,
                                    size_t budget);

}  // namespace vgtw
