// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <span>

#include <Eigen/Core>

namespace vgtw {

// Largest angle (degrees) at which two of the camera centres see the point; at most `enough_deg` is
// told apart.
double TriangulationAngleDeg(std::span<const Eigen::Vector3d> centres,
                             const Eigen::Vector3d& point,
                             double enough_deg = 180.0);

}  // namespace vgtw
