// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include <Eigen/Core>

namespace vgtw {

// One point per occupied cube of edge `voxel_size` (> 0) of the lattice through the origin: the
// mean of the points in it, ordered by cube. Cubes are half-open: [i, i + 1) * voxel_size.
// Throws std::invalid_argument if a point is not finite or lies more than 2^62 cubes away, or if
// there are 2^32 points or more.
std::vector<Eigen::Vector3d> MeanInVoxels(const std::vector<Eigen::Vector3d>& points,
                                          double voxel_size);

}  // namespace vgtw
