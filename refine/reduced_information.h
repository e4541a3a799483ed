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

// The inverse of the information, by what is asked of it.
class InverseInformation {
 public:
  explicit InverseInformation(const Eigen::MatrixXd& information);

  // The diagonal block. All NaN where the variance is 1e10 times or more what it would be if all
  // other blocks were known: there it is undetermined.
  Eigen::MatrixXd Covariance(const ReducedBlock& block) const;

  // Sum of trace(J S^-1 J^T) over residual blocks without point, J their derivatives by `blocks`,
  // weighted: how much of their variance, of num_residuals each, the adjustment takes away. At most
  // that number of each.
  double Leverage(const ceres::Problem& problem,
                  const std::vector<ceres::ResidualBlockId>& ids,
                  const std::vector<ReducedBlock>& blocks,
                  const ResidualWeight& weight) const;

 private:
  Eigen::VectorXd units_;
  Eigen::MatrixXd inverse_factor_;  // L^-1 in these units, empty if there is none
};

}  // namespace vgtw
