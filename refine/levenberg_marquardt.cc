// SPDX-License-Identifier: BSD-3-Clause
#include "refine/levenberg_marquardt.h"

#include "refine/schur_system.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

namespace vgtw {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMaxRadius = 1e16;
constexpr double kMinRadius = 1e-32;
// A step is taken if the cost falls by this share of what was predicted.
constexpr double kMinDecreaseRatio = 1e-3;
// A decrease of less than this share of the cost is lost in rounding.
constexpr double kRounding = 1e-15;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Adds the time that it lives to `seconds`.
class Stopwatch {
 public:
  explicit Stopwatch(double& seconds) : seconds_(seconds) {}
  ~Stopwatch() { seconds_ += SecondsSince(start_); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& seconds_;
  const Clock::time_point start_ = Clock::now();
};

// Starting a thread takes as long as some thousand residuals do.
int UsefulThreads(int num_threads, int num_residuals) {
  return std::min(num_threads, 1 + num_residuals / 10000);
}

class TrustRegion {
 public:
  explicit TrustRegion(double radius) : radius_(radius) {}

  double radius() const { return radius_; }

  void Accept(double ratio) {
    radius_ =
        std::min(kMaxRadius, radius_ / std::max(1.0 / 3.0, 1.0 - std::pow(2.0 * ratio - 1.0, 3)));
    shrinkage_ = 2.0;
  }

  void Refuse() {
    radius_ /= shrinkage_;
    shrinkage_ *= 2.0;
  }

 private:
  double radius_;
  double shrinkage_ = 2.0;
};

class Minimiser {
 public:
  Minimiser(const LevenbergMarquardtOptions& options,
            const ceres::Problem& problem,
            std::span<Eigen::Vector3d> points)
      : options_(options),
        system_(problem, points, UsefulThreads(options.num_threads, problem.NumResiduals())),
        region_(options.initial_radius) {}

  LevenbergMarquardtSummary Run() {
    const std::optional<double> cost = Linearise();
    if (!cost) {
      summary_.message = "the residuals at the start are not finite";
      return summary_;
    }
    summary_.is_usable = true;
    summary_.initial_cost = summary_.final_cost = *cost;
    while (ShouldGoOn()) {
      ++summary_.num_iterations;
      Iterate();
    }
    return summary_;
  }

 private:
  // Whether there is reason for another iteration; the message says what ended them.
  bool ShouldGoOn() {
    const bool is_stopped = options_.on_iteration &&
                            !options_.on_iteration(summary_.num_iterations, summary_.final_cost);
    if (!summary_.message.empty()) return false;
    if (is_stopped) {
      summary_.message = "stopped by the caller";
    } else if (summary_.num_iterations >= options_.max_num_iterations) {
      summary_.message = "maximum number of iterations";
    } else if (SecondsSince(start_) >= options_.max_seconds) {
      summary_.message = "maximum time";
    } else if (region_.radius() < kMinRadius) {
      summary_.message = "no step lowers the cost";
    }
    return summary_.message.empty();
  }

  std::optional<double> Linearise() {
    const Stopwatch stopwatch(summary_.evaluation_sec);
    return system_.Linearise();
  }

  std::optional<SchurSystem::Step> Solve() {
    const Stopwatch stopwatch(summary_.linear_solver_sec);
    return system_.Solve(region_.radius());
  }

  // Whether the step is so small, or promises so little, that the minimum is reached.
  bool HasConverged(const SchurSystem::Step& step) {
    if (step.max_gradient <= options_.gradient_tolerance) {
      summary_.message = "converged: the gradient vanishes";
    } else if (std::sqrt(step.squared_norm) <=
               options_.parameter_tolerance *
                   (std::sqrt(system_.SquaredNorm()) + options_.parameter_tolerance)) {
      summary_.message = "converged: the parameters stay";
    } else if (std::abs(step.model_decrease) <= kRounding * summary_.final_cost) {
      summary_.message = "converged: the cost stays";
    }
    return !summary_.message.empty();
  }

  void Iterate() {
    const std::optional<SchurSystem::Step> step = Solve();
    if (step && HasConverged(*step)) return;
    if (!step || !(step->model_decrease > 0.0)) {
      region_.Refuse();
      return;
    }
    system_.Apply(*step);
    const std::optional<double> cost = CostOfStep();
    const double decrease = cost ? summary_.final_cost - *cost : -1.0;
    const double ratio = decrease / step->model_decrease;
    if (!(ratio > kMinDecreaseRatio)) {
      system_.Undo();
      region_.Refuse();
      return;
    }
    const bool is_small = decrease <= options_.function_tolerance * summary_.final_cost;
    summary_.final_cost = *cost;
    region_.Accept(ratio);
    if (is_small) {
      summary_.message = "converged: the cost stays";
    } else if (summary_.num_iterations < options_.max_num_iterations && !Linearise()) {
      summary_.message = "the derivatives are not finite";
    }
  }

  std::optional<double> CostOfStep() {
    const Stopwatch stopwatch(summary_.evaluation_sec);
    return system_.Cost();
  }

  const LevenbergMarquardtOptions& options_;
  const Clock::time_point start_ = Clock::now();
  SchurSystem system_;
  TrustRegion region_;
  LevenbergMarquardtSummary summary_;
};

}  // namespace

LevenbergMarquardtSummary Minimise(const LevenbergMarquardtOptions& options,
                                   const ceres::Problem& problem,
                                   std::span<Eigen::Vector3d> points) {
  return Minimiser(options, problem, points).Run();
}

}  // namespace vgtw
