// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <ceres/ceres.h>

namespace vgtw {

// A free parameter block other than a point.
struct ReducedBlock {
  const double* values = nullptr;
  int offset = 0;  // of its tangent in the reduced system
  int size = 0;    // of its tangent
};

std::vector<ReducedBlock> FindReducedBlocks(const ceres::Problem& problem,
                                            std::span<const Eigen::Vector3d> points);

// The weight of a residual block with this squared norm.
using ResidualWeight = std::function<double(ceres::ResidualBlockId, double squared_norm)>;

// J^T W J of the tangents of `blocks` after eliminating the points:  U - sum_p W_p V_p^-1 W_p^T.
// The lower triangle is filled. A direction in which a point is free, because all its rays are
// parallel, holds nothing of the blocks either and is left out.
// Residual blocks must have at most one point, and points must be free and Euclidean.
Eigen::MatrixXd ReduceInformation(const ceres::Problem& problem,
                                  std::span<const Eigen::Vector3d> points,
                                  const std::vector<ReducedBlock>& blocks,
                                  const ResidualWeight& weight);

// The diagonal blocks of the inverse. Blocks whose variance is 1e10 times or more what it would be
// if all others were known are undetermined: all NaN.
std::vector<Eigen::MatrixXd> BlockCovariances(const std::vector<ReducedBlock>& blocks,
                                              const Eigen::MatrixXd& information);

}  // namespace vgtw
