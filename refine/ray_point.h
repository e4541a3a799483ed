// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/rigid3d.h"

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What one view says about a point: the ray through its pixel, and how many pixels an offset across
// the ray makes there. With it the reprojection error needs no camera model: to first order in the
// error it equals that of the lens, whatever its distortion.
struct PixelRay {
  Eigen::Vector3d centre;                    // of the camera, in the world
  Eigen::Vector3d direction;                 // unit length, in the world
  Eigen::Vector3d axis;                      // of the camera, in the world
  Eigen::Matrix<double, 2, 3> pixel_from_x;  // of the offset across, divided by the distance along
};

// nullopt where the pixel has no ray (distortion that cannot be inverted there).
std::optional<PixelRay> MakePixelRay(const Camera& camera,
                                     const Rigid3d& cam_from_world,
                                     const Eigen::Vector2d& pixel);

// Reprojection error in pixels; infinite if the point is not in front.
double ErrorPx(const PixelRay& ray, const Eigen::Vector3d& point);

// Minimises  sum_i log(1 + (error_i / scale_px)^2)  from the best of what pairs of rays, all rays
// together and `start` say: wrong rays hardly count. nullopt if no hypothesis lies in front of two
// rays.
std::optional<Eigen::Vector3d> EstimateRayPoint(
    std::span<const PixelRay* const> rays,
    double scale_px,
    const std::optional<Eigen::Vector3d>& start = std::nullopt);

}  // namespace vgtw
