// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/grid.h"
#include "scene/image_io.h"

#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Grey levels of a photo reduced to at most kDetailSide pixels, less their local mean: what two
// photos of the same surface share, and two photos of different surfaces under the same light do
// not.
inline constexpr int kDetailSide = 256;
using PhotoDetail = Grid<float>;

PhotoDetail MakePhotoDetail(const RgbImage& image);

// Value at a position in [0,1] x [0,1] of the photo, by the nearest pixel; 0 outside.
float DetailAt(const PhotoDetail& detail, const Eigen::Vector2d& relative_position);

// Correlation coefficient in [-1,1]; 0 where either side is constant or there are fewer than two
// values. Throws std::invalid_argument if the lengths differ.
double Correlation(const std::vector<float>& a, const std::vector<float>& b);

}  // namespace vgtw
