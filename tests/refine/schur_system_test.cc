// SPDX-License-Identifier: BSD-3-Clause
#include "refine/schur_system.h"

#include "tests/refine/point_problem.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/SparseCore>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// What Ceres says of the problem: the scaled Jacobian and residuals as dense matrices.
struct DenseProblem {
  double cost = 0.0;
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd residuals;

  explicit DenseProblem(ceres::Problem& problem) {
    std::vector<double> values;
    ceres::CRSMatrix sparse;
    problem.Evaluate(ceres::Problem::EvaluateOptions(), &cost, &values, nullptr, &sparse);
    residuals = Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<int>(values.size()));
    jacobian.setZero(sparse.num_rows, sparse.num_cols);
    for (int row = 0; row < sparse.num_rows; ++row) {
      for (int i = sparse.rows[static_cast<size_t>(row)];
           i < sparse.rows[static_cast<size_t>(row) + 1];
           ++i) {
        jacobian(row, sparse.cols[static_cast<size_t>(i)]) = sparse.values[static_cast<size_t>(i)];
      }
    }
  }

  // Columns in units in which the diagonal of J^T J is about 1, as in the header.
  Eigen::VectorXd Solve(double radius) const {
    const Eigen::VectorXd unit =
        (1.0 + jacobian.colwise().norm().array()).inverse().matrix().transpose();
    const Eigen::MatrixXd scaled = jacobian * unit.asDiagonal();
    Eigen::MatrixXd hessian = scaled.transpose() * scaled;
    hessian.diagonal() += hessian.diagonal().cwiseMax(1e-6) / radius;
    return unit.asDiagonal() * hessian.ldlt().solve(-scaled.transpose() * residuals);
  }
};

TEST(SchurSystem, StepIsThatOfTheWholeSystem) {
  for (const bool with_loss : {false, true}) {
    PointProblem test(1, with_loss);
    const DenseProblem dense(test.problem());
    SchurSystem system(test.problem(), test.points, 2);
    const std::optional<double> cost = system.Linearise();
    ASSERT_TRUE(cost);
    EXPECT_NEAR(*cost, dense.cost, 1e-12 * dense.cost);
    EXPECT_NEAR(system.Cost().value(), dense.cost, 1e-12 * dense.cost);
    for (const double radius : {1e-2, 1e4}) {
      const std::optional<SchurSystem::Step> step = system.Solve(radius);
      ASSERT_TRUE(step);
      const Eigen::VectorXd expected = dense.Solve(radius);
      // Condition numbers of 1e6 or so.
      EXPECT_NEAR(step->squared_norm, expected.squaredNorm(), 1e-9 * expected.squaredNorm());
      const Eigen::VectorXd change = dense.jacobian * expected;
      const double model_decrease = -change.dot(dense.residuals + 0.5 * change);
      EXPECT_NEAR(step->model_decrease, model_decrease, 1e-9 * model_decrease);
      const double gradient = (dense.jacobian.transpose() * dense.residuals).cwiseAbs().maxCoeff();
      EXPECT_NEAR(step->max_gradient, gradient, 1e-9 * gradient);
    }
    // The same parameters have moved by the same amounts.
    const std::vector<double> before = test.Values();
    const std::optional<SchurSystem::Step> step = system.Solve(1e4);
    system.Apply(*step);
    const double cost_after = system.Cost().value();
    EXPECT_LT(cost_after, *cost);
    system.Undo();
    EXPECT_EQ(test.Values(), before);
  }
}

TEST(SchurSystem, DoesNotDependOnThreads) {
  std::vector<std::vector<double>> values;
  for (const int num_threads : {1, 4}) {
    PointProblem test(2);
    SchurSystem system(test.problem(), test.points, num_threads);
    ASSERT_TRUE(system.Linearise());
    system.Apply(system.Solve(1e4).value());
    values.push_back(test.Values());
  }
  EXPECT_EQ(values[0], values[1]);
}

TEST(SchurSystem, HasNoCostWithoutFiniteResiduals) {
  PointProblem test(3);
  test.points[5].setConstant(std::numeric_limits<double>::quiet_NaN());
  SchurSystem system(test.problem(), test.points, 1);
  EXPECT_FALSE(system.Cost());
  EXPECT_FALSE(system.Linearise());
}

// Two points in one residual couple each other, and more than two residuals have no room.
TEST(SchurSystem, RefusesOtherProblems) {
  const auto between_points = [](const double* a, const double* b, double* residual) {
    residual[0] = a[0] - b[0];
    return true;
  };
  std::vector<Eigen::Vector3d> points(2, Eigen::Vector3d::Zero());
  using Cost = decltype(between_points);
  ceres::Problem problem;
  problem.AddResidualBlock(
      new ceres::NumericDiffCostFunction<Cost, ceres::CENTRAL, 1, 3, 3>(new Cost(between_points)),
      nullptr,
      points[0].data(),
      points[1].data());
  EXPECT_THROW(SchurSystem(problem, points, 1), std::invalid_argument);

  const auto three = [](const double* a, double* residual) {
    std::copy_n(a, 3, residual);
    return true;
  };
  using Three = decltype(three);
  ceres::Problem with_three;
  with_three.AddResidualBlock(
      new ceres::NumericDiffCostFunction<Three, ceres::CENTRAL, 3, 3>(new Three(three)),
      nullptr,
      points[0].data());
  EXPECT_THROW(SchurSystem(with_three, points, 1), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
