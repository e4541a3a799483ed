// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <string>
#include <vector>

namespace vgtw {

// A picture and the line above it; what does not fit over the picture is cut off.
struct Tile {
  std::string caption;
  RgbImage picture;
};

// Rows of pictures on white, with a margin of 8 px around each and 24 px above it for the caption;
// a row is as high as its highest picture. No picture may be empty.
RgbImage MakeTileSheet(const std::vector<std::vector<Tile>>& rows);

}  // namespace vgtw
