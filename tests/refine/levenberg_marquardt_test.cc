// SPDX-License-Identifier: BSD-3-Clause
#include "refine/levenberg_marquardt.h"

#include "tests/refine/point_problem.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::vector<double> CostsByCeres(ceres::Problem& problem, int max_num_iterations) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = max_num_iterations;
  options.function_tolerance = 0.0;
  options.parameter_tolerance = 1e-10;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  std::vector<double> costs;
  for (const ceres::IterationSummary& iteration : summary.iterations) {
    costs.push_back(costs.empty() || iteration.step_is_successful ? iteration.cost : costs.back());
  }
  return costs;
}

TEST(Minimise, TakesTheStepsOfCeres) {
  for (const bool with_loss : {false, true}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      PointProblem by_ceres(seed, with_loss);
      PointProblem by_us(seed, with_loss);
      const std::vector<double> expected = CostsByCeres(by_ceres.problem(), 60);
      std::vector<double> costs;
      LevenbergMarquardtOptions options;
      options.max_num_iterations = 60;
      options.num_threads = 2;
      options.on_iteration = [&costs](int, double cost) {
        costs.push_back(cost);
        return true;
      };
      const LevenbergMarquardtSummary summary = Minimise(options, by_us.problem(), by_us.points);
      EXPECT_TRUE(summary.is_usable);
      ASSERT_EQ(costs.size(), static_cast<size_t>(summary.num_iterations) + 1);
      EXPECT_EQ(summary.initial_cost, costs.front());
      EXPECT_EQ(summary.final_cost, costs.back());
      for (size_t i = 0; i < std::min<size_t>({costs.size(), expected.size(), 12}); ++i) {
        // Roundings grow from step to step as far as the problem's condition lets them.
        EXPECT_NEAR(costs[i], expected[i], 1e-7 * expected[i]) << i;
      }
      EXPECT_NEAR(summary.final_cost, expected.back(), 1e-9 * expected.back());
      const std::vector<double> a = by_us.Values();
      const std::vector<double> b = by_ceres.Values();
      for (size_t i = 0; i < a.size(); ++i) {
        EXPECT_NEAR(a[i], b[i], 1e-5 * std::max(1.0, std::abs(b[i]))) << i;
      }
    }
  }
}

TEST(Minimise, StopsInTimeAndKeepsTheBest) {
  PointProblem test(4);
  const std::vector<double> before = test.Values();
  LevenbergMarquardtOptions options;
  options.max_seconds = 0.0;
  LevenbergMarquardtSummary summary = Minimise(options, test.problem(), test.points);
  EXPECT_TRUE(summary.is_usable);
  EXPECT_EQ(summary.message, "maximum time");
  EXPECT_EQ(summary.num_iterations, 0);
  EXPECT_EQ(test.Values(), before);

  options.max_seconds = 0.05;
  options.on_iteration = [](int iteration, double) {
    if (iteration == 2) std::this_thread::sleep_for(std::chrono::milliseconds(60));
    return true;
  };
  summary = Minimise(options, test.problem(), test.points);
  EXPECT_EQ(summary.message, "maximum time");
  EXPECT_LE(summary.num_iterations, 2);
  double cost = 0.0;
  test.problem().Evaluate({}, &cost, nullptr, nullptr, nullptr);
  EXPECT_NEAR(summary.final_cost, cost, 1e-12 * cost);
}

TEST(Minimise, EndsWhereTheGradientVanishes) {
  PointProblem test(5);
  LevenbergMarquardtOptions options;
  options.max_num_iterations = 200;
  Minimise(options, test.problem(), test.points);
  options.gradient_tolerance = 1e-3;
  const LevenbergMarquardtSummary summary = Minimise(options, test.problem(), test.points);
  EXPECT_EQ(summary.message, "converged: the gradient vanishes");
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
}

TEST(Minimise, LeavesAStartThatIsNotFinite) {
  PointProblem test(6);
  test.points[0].x() = std::numeric_limits<double>::infinity();
  const LevenbergMarquardtSummary summary = Minimise({}, test.problem(), test.points);
  EXPECT_FALSE(summary.is_usable);
  EXPECT_EQ(summary.message, "the residuals at the start are not finite");
}

}  // namespace
}  // namespace vgtw
