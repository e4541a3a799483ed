// SPDX-License-Identifier: BSD-3-Clause
#include "refine/bundle_adjustment.h"

#include "refine/bundle_problem.h"
#include "scene/error.h"
#include "scene/reprojection.h"

#include <chrono>
#include <string>

namespace vgtw {

void BundleAdjustmentOptions::Check() const {
  VGTW_CHECK(loss_scale_px > 0.0,
             "BundleAdjustmentOptions::loss_scale_px = " + std::to_string(loss_scale_px) +
                 ", must be > 0");
  VGTW_CHECK(max_num_iterations >= 0,
             "BundleAdjustmentOptions::max_num_iterations = " + std::to_string(max_num_iterations) +
                 ", must be >= 0");
  VGTW_CHECK(function_tolerance >= 0.0 && function_tolerance < 1.0,
             "BundleAdjustmentOptions::function_tolerance = " + std::to_string(function_tolerance) +
                 ", must be in [0, 1)");
  VGTW_CHECK(
      max_seconds >= 0.0,
      "BundleAdjustmentOptions::max_seconds = " + std::to_string(max_seconds) + ", must be >= 0");
  priors.Check();
}

BundleAdjustmentSummary AdjustBundle(const BundleAdjustmentOptions& options,
                                     Reconstruction& reconstruction) {
  options.Check();
  const std::string fault = FindFault(reconstruction);
  VGTW_CHECK(fault.empty(), fault);

  const auto start = std::chrono::steady_clock::now();
  BundleAdjustmentSummary summary;
  const BundleParticipants participants = FindBundleParticipants(reconstruction);
  if (participants.point3D_ids.empty()) {
    summary.message = "no point is observed by two images";
    return summary;
  }
  BundleProblem problem(options, reconstruction, participants);
  const LevenbergMarquardtSummary solved = problem.Solve();
  summary.message = solved.message;
  summary.num_residuals = static_cast<size_t>(problem.num_residuals());
  summary.initial_cost = solved.initial_cost;
  summary.final_cost = solved.final_cost;
  summary.num_iterations = solved.num_iterations;
  summary.evaluation_sec = solved.evaluation_sec;
  summary.linear_solver_sec = solved.linear_solver_sec;
  summary.gauge = problem.gauge().description;
  summary.priors = problem.priors().Summarize();
  if (!solved.is_usable) return summary;

  if (!problem.IsPossible()) {
    summary.message = "the solution is not a possible reconstruction (" + solved.message + ")";
    return summary;
  }
  problem.WriteTo(reconstruction);
  UpdateFrames(reconstruction);
  UpdatePointErrors(reconstruction);
  summary.total_sec =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  summary.success = true;
  return summary;
}

}  // namespace vgtw
