// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/depth_map.h"
#include "scene/grid.h"

#include <optional>

#include <Eigen/Core>

namespace vgtw {

struct PinholeFit {
  Eigen::Matrix3d intrinsics;  // pixels of the map, continuous: the first centre is (0.5, 0.5)
  double median_error_px = 0.0;
};

// The pinhole that explains best where the points of a map, in the frame of their camera, meet the
// image: weighted least squares over u = fx x / z + cx, and v alike. Networks that predict points
// and no intrinsics (pi3) are read so. `weights` may be empty; points that are not finite or not in
// front (z <= 0) and weights that are not positive do not count. nullopt if fewer than 16 points
// count, or if they leave a focal length open or make it <= 0.
std::optional<PinholeFit> FitPinhole(const Grid<Eigen::Vector3f>& points_in_cam,
                                     const ConfidenceMap& weights);

}  // namespace vgtw
