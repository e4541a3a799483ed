// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/depth_error.h"
#include "scene/depth_map.h"
#include "scene/view.h"

#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Depth maps on the grid of pixels that another view of the same photo, or of the same world, has.

// A depth map of `from` at the pixels of `onto`, both of the same photo: bilinear (see SampleDepth)
// at the same place of the photo, unknown beyond the map. Where both views have the same grid every
// value is kept as it is.
DepthMap RegridDepth(const View& from,
                     const DepthMap& depth,
                     const View& onto,
                     double max_relative_step);

// The z-depths of world points in a view's pixels, by a z-buffer: a point falls into the pixel that
// its projection lies in, and the nearest of a pixel's points is its depth; unknown where none is.
// Points have no extent, so that what is sparse on this grid lets pixels see what lies behind it.
DepthMap ProjectPoints(const View& view, const std::vector<Eigen::Vector3d>& points_in_world);

// Adds the depths of the pixels that are known in both maps, of one size, and expected to be at
// most `max_depth`.
void AddCommonDepths(const DepthMap& predicted,
                     const DepthMap& expected,
                     double max_depth,
                     DepthPairs& pairs);

}  // namespace vgtw
