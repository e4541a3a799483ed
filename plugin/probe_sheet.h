// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"
#include "scene/view.h"

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct ProbePhoto {
  std::string name;
  RgbImage photo;
  PixelMap original_from_patch;
};

struct ProbeQuery {
  size_t view = 0;
  Eigen::Vector2d pixel_in_original = Eigen::Vector2d::Zero();
};

// The colours' range: from the smallest to the 99.5 % percentile of all views, which single peaks
// do not darken.
std::pair<float, float> RangeOf(const std::vector<Grid<float>>& maps);

// One kind of map: per view a caption and one value per patch.
struct ProbeColumn {
  std::vector<std::string> captions;
  const std::vector<Grid<float>>* maps = nullptr;
  std::pair<float, float> range;  // of the colours
};

// A row per view: the photo with the query in red, then each column's map over the gray photo, dark
// blue = low to yellow = high.
RgbImage MakeProbeSheet(const std::vector<ProbePhoto>& photos,
                        const ProbeQuery& query,
                        const std::vector<ProbeColumn>& columns,
                        int tile_width = 400);

}  // namespace vgtw
