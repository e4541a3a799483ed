// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/scene_stream_world.h"

#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Everything that a view's rays meet: the pieces of the static scene, then those of distractors.
struct SeenView {
  size_t view_idx = 0;
  std::vector<SolidInView> solids;
  std::vector<int> surfaces;  // of the solids
  size_t num_static = 0;
  HitMap static_hits;
  HitMap hits;

  bool ShowsDistractor(int x, int y) const {
    return hits.index(x, y) >= static_cast<int32_t>(num_static);
  }
};
SeenView SeeView(const StreamWorld& world, size_t view_idx);

// RGB at every pixel, 0 black and 1 white, not clamped. One ray a pixel, since textures filter
// themselves; where it meets another piece than its neighbours, four rays share the pixel.
Grid<Eigen::Vector3f> PaintView(const StreamWorld& world, const SeenView& seen);

// What lens, sensor and exposure make of it: vignetting, gain, white balance, blur, noise; drawn
// for this view.
RgbImage Photograph(const Grid<Eigen::Vector3f>& picture, RandomStream& random);

}  // namespace vgtw
