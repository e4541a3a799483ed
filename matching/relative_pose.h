// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// The same point as two calibrated cameras see it: (x/z, y/z) in each.
struct RayPair {
  Eigen::Vector2d ray1;
  Eigen::Vector2d ray2;
};

// E = [t]x R of cam2_from_cam1:  ray2^T E ray1 = 0  with homogeneous rays.
Eigen::Matrix3d EssentialMatrix(const Rigid3d& cam2_from_cam1);

// Sampson's distance of a pair from M, an essential matrix for rays or a fundamental one for
// pixels, in their unit: the distance to the nearest pair that fulfils the equation, to first order
//   |x2^T M x1| / sqrt((M x1)_1^2 + (M x1)_2^2 + (M^T x2)_1^2 + (M^T x2)_2^2).
double SampsonDistance(const Eigen::Matrix3d& matrix,
                       const Eigen::Vector2d& x1,
                       const Eigen::Vector2d& x2);

// Minimises  sum log(1 + (distance / scale)^2)  over Sampson's distances of the pairs: 5 degrees of
// freedom, the length of the translation stays 1. `scale` is in the unit of rays, > 0.
// Source: Hartley and Zisserman, Multiple View Geometry, 11.4; loss of Cauchy.
Rigid3d RefineRelativePose(const std::vector<RayPair>& pairs,
                           double scale,
                           const Rigid3d& cam2_from_cam1);

// Of the four poses that an essential matrix allows, the one with most points in front of both
// cameras; unit translation.
Rigid3d RelativePoseFromEssential(const Eigen::Matrix3d& E, const std::vector<RayPair>& pairs);

// Depths (z in camera 1, z in camera 2) where the rays come nearest to each other; nullopt where
// they are parallel.
std::optional<Eigen::Vector2d> TriangulateDepths(const RayPair& pair,
                                                 const Rigid3d& cam2_from_cam1);

// The rotation that best turns rays of camera 1 into those of camera 2, for a camera that turned
// on the spot:  maximises  sum ray2 . R ray1  over unit rays.
// Source: Umeyama, 1991, without scale and translation.
Eigen::Quaterniond RotationBetween(const std::vector<RayPair>& pairs);

}  // namespace vgtw
