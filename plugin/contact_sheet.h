// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/image_io.h"

#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// One photo on a contact sheet. Pixels are those of the photo.
struct ContactSheetRow {
  std::string name;
  RgbImage photo;
  StaticMask static_mask;
  std::vector<Eigen::Vector2d> kept_features;
  std::vector<Eigen::Vector2d> dropped_features;
};

// Three pictures a row: the photo, what the mask excludes (red), and the features that were kept
// (green) and dropped (red), under a line of captions. `tile_width` in pixels.
RgbImage MakeContactSheet(const std::vector<ContactSheetRow>& rows, int tile_width = 400);

}  // namespace vgtw
