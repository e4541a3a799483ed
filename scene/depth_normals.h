// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/depth_map.h"
#include "scene/grid.h"
#include "scene/view.h"

#include <Eigen/Core>

namespace vgtw {

// Unit normals [H,W] of the surface that a depth map [H,W] samples, in camera coordinates, towards
// the camera: normal . point_in_cam < 0. They are the cross product of what lies between the
// neighbours' points along x and along y, exact where the surface is a plane. A neighbour across a
// depth edge (more than `max_relative_step`) has no say; where an axis has none left, or depth is
// unknown, the normal is zero.
Grid<Eigen::Vector3f> NormalsFromDepth(const View& view,
                                       const DepthMap& depth,
                                       double max_relative_step = 0.05);

}  // namespace vgtw
