// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trajectory_error.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace vgtw {
namespace {

// cam1_from_cam2 = P_1^-1 P_2.
Rigid3d Relative(const Rigid3d& cam1_from_world, const Rigid3d& cam2_from_world) {
  return cam1_from_world * Inverse(cam2_from_world);
}

}  // namespace

ErrorStatistics ComputeErrorStatistics(const std::vector<double>& errors) {
  VGTW_CHECK(!errors.empty(), "there is an error to summarise");
  const auto num_errors = static_cast<double>(errors.size());
  ErrorStatistics statistics;
  for (const double error : errors) {
    statistics.rmse += error * error;
    statistics.mean += error;
  }
  statistics.rmse = std::sqrt(statistics.rmse / num_errors);
  statistics.mean /= num_errors;
  statistics.median = Median(errors);
  statistics.max = *std::max_element(errors.begin(), errors.end());
  return statistics;
}

ErrorStatistics ComputeAte(const std::vector<ViewPoseError>& views) {
  std::vector<double> distances;
  for (const ViewPoseError& view : views) distances.push_back(view.centre);
  return ComputeErrorStatistics(distances);
}

void RpeOptions::Check() const {
  VGTW_CHECK(delta >= 1, "RpeOptions::delta = " + std::to_string(delta) + ", must be >= 1");
}

std::optional<RelativePoseErrors> ComputeRpe(const std::vector<ViewPoseError>& views,
                                             const RpeOptions& options) {
  options.Check();
  const auto delta = static_cast<size_t>(options.delta);
  std::vector<double> translations;
  std::vector<double> rotations_deg;
  for (size_t i = 0; i + delta < views.size(); i += options.all_pairs ? 1 : delta) {
    const ViewPoseError& first = views[i];
    const ViewPoseError& second = views[i + delta];
    const Rigid3d expected =
        Relative(first.expected_cam_from_world, second.expected_cam_from_world);
    const Rigid3d estimated =
        Relative(first.estimated_cam_from_world, second.estimated_cam_from_world);
    const Rigid3d error = Inverse(expected) * estimated;
    translations.push_back(error.translation.norm());
    rotations_deg.push_back(AngleBetweenDeg(expected.rotation, estimated.rotation));
  }
  if (translations.empty()) return std::nullopt;
  return RelativePoseErrors{translations.size(),
                            ComputeErrorStatistics(translations),
                            ComputeErrorStatistics(rotations_deg)};
}

}  // namespace vgtw
