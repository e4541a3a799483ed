// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"

#include <memory>

#include <Eigen/Core>
#include <ceres/cost_function.h>

namespace vgtw {

// cam_from_world as one block: quaternion xyzw (Eigen's order), then translation.
inline constexpr int kNumPoseParams = 7;

// Residual (pixels):  project(camera, cam_from_world * point) - pixel.
// Blocks: pose [7], point in the world [3], the camera's parameters in COLMAP's order.
// A point that passes behind the camera while the solver iterates projects through the centre
// (x/z with negative z), which is continuous for points that pass through infinity; a point in the
// camera's plane has no projection, and the solver shortens its step.
std::unique_ptr<ceres::CostFunction> MakeReprojectionCost(CameraModel model,
                                                          const Eigen::Vector2d& pixel);

}  // namespace vgtw
