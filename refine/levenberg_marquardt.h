// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <span>
#include <string>

#include <Eigen/Core>
#include <ceres/problem.h>

namespace vgtw {

struct LevenbergMarquardtOptions {
  int max_num_iterations = 50;
  double max_seconds = std::numeric_limits<double>::infinity();
  // Done when an iteration lowers the cost by less than this share.
  double function_tolerance = 0.0;
  // Done when a step is shorter than this share of the parameters.
  double parameter_tolerance = 1e-10;
  // Done when no element of the gradient is larger.
  double gradient_tolerance = 1e-10;
  double initial_radius = 1e4;  // of the trust region: the inverse of the damping
  int num_threads = 1;
  // Called with (iteration, cost so far) at the start and after each iteration; false stops.
  std::function<bool(int, double)> on_iteration;
};

struct LevenbergMarquardtSummary {
  bool is_usable = false;  // the parameters are those of the least cost that was met
  std::string message;
  double initial_cost = 0.0;  // half the sum of the losses
  double final_cost = 0.0;
  int num_iterations = 0;  // with those whose step was refused
  double evaluation_sec = 0.0;
  double linear_solver_sec = 0.0;
};

// Minimises what ceres::Solve minimises, by the same steps as its Levenberg-Marquardt method takes
// with SPARSE_SCHUR (trust region by the ratio of real to predicted decrease, Madsen, Nielsen and
// Tingleff, "Methods for non-linear least squares problems", 2004), but several times faster for
// problems of many points: see refine/schur_system.h, which also has the law of the problem.
LevenbergMarquardtSummary Minimise(const LevenbergMarquardtOptions& options,
                                   const ceres::Problem& problem,
                                   std::span<Eigen::Vector3d> points);

}  // namespace vgtw
