// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_error.h"

#include "scene/statistics.h"

#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Core>

namespace vgtw {
namespace {

// Share of the extent below which two centres give no direction.
constexpr double kMinRelativeBaseline = 1e-9;

std::vector<Eigen::Vector3d> Centres(const std::vector<Rigid3d>& cams_from_world) {
  std::vector<Eigen::Vector3d> centres;
  centres.reserve(cams_from_world.size());
  for (const Rigid3d& cam_from_world : cams_from_world) {
    centres.push_back(OriginInSource(cam_from_world));
  }
  return centres;
}

double AngleBetweenDirectionsDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

// Fills relative_rotation_deg of every view; returns the median over all pairs.
double MedianRelativeRotationDeg(const std::vector<Rigid3d>& estimate,
                                 const std::vector<Rigid3d>& reference,
                                 std::vector<ViewPoseError>& views) {
  std::vector<double> errors_deg;
  errors_deg.reserve(estimate.size() * (estimate.size() - 1) / 2);
  std::vector<std::vector<double>> errors_deg_by_view(views.size());
  for (size_t i = 0; i < estimate.size(); ++i) {
    for (size_t j = i + 1; j < estimate.size(); ++j) {
      const double error_deg =
          AngleBetweenDeg(estimate[j].rotation * estimate[i].rotation.conjugate(),
                          reference[j].rotation * reference[i].rotation.conjugate());
      errors_deg.push_back(error_deg);
      errors_deg_by_view[i].push_back(error_deg);
      errors_deg_by_view[j].push_back(error_deg);
    }
  }
  for (size_t i = 0; i < views.size(); ++i) {
    views[i].relative_rotation_deg = Median(std::move(errors_deg_by_view[i]));
  }
  return Median(std::move(errors_deg));
}

// The direction to camera 2 in camera 1's frame does not depend on the world.
double MedianRelativeDirectionDeg(const std::vector<Rigid3d>& estimate,
                                  const std::vector<Rigid3d>& reference,
                                  double estimate_extent,
                                  double reference_extent) {
  const std::vector<Eigen::Vector3d> estimate_centres = Centres(estimate);
  const std::vector<Eigen::Vector3d> reference_centres = Centres(reference);
  std::vector<double> errors_deg;
  errors_deg.reserve(estimate.size() * (estimate.size() - 1) / 2);
  for (size_t i = 0; i < estimate.size(); ++i) {
    for (size_t j = i + 1; j < estimate.size(); ++j) {
      const Eigen::Vector3d estimated = estimate_centres[j] - estimate_centres[i];
      const Eigen::Vector3d expected = reference_centres[j] - reference_centres[i];
      if (estimated.norm() < kMinRelativeBaseline * estimate_extent ||
          expected.norm() < kMinRelativeBaseline * reference_extent) {
        continue;
      }
      errors_deg.push_back(AngleBetweenDirectionsDeg(estimate[i].rotation * estimated,
                                                     reference[i].rotation * expected));
    }
  }
  return Median(std::move(errors_deg));  // not empty: the centres are not all the same
}

}  // namespace

std::optional<PoseComparison> ComparePoses(const std::map<std::string, Rigid3d>& estimate,
                                           const std::map<std::string, Rigid3d>& reference) {
  PoseComparison comparison;
  std::vector<Rigid3d> estimated;
  std::vector<Rigid3d> expected;
  std::vector<Eigen::Vector3d> all_reference_centres;
  for (const auto& [name, cam_from_reference] : reference) {
    all_reference_centres.push_back(OriginInSource(cam_from_reference));
    const auto found = estimate.find(name);
    if (found == estimate.end()) {
      ++comparison.num_missing;
      continue;
    }
    comparison.views.push_back({.name = name});
    estimated.push_back(found->second);
    expected.push_back(cam_from_reference);
  }

  const std::vector<Eigen::Vector3d> estimated_centres = Centres(estimated);
  const std::vector<Eigen::Vector3d> expected_centres = Centres(expected);
  const std::optional<Sim3d> alignment = EstimateSim3d(estimated_centres, expected_centres);
  if (!alignment) return std::nullopt;
  comparison.reference_from_estimate = *alignment;
  comparison.extent = Diameter(all_reference_centres);

  double sum_squared = 0.0;
  std::vector<double> rotations_deg;
  for (size_t i = 0; i < comparison.views.size(); ++i) {
    ViewPoseError& view = comparison.views[i];
    view.rotation_deg =
        AngleBetweenDeg(TransformCamera(*alignment, estimated[i]).rotation, expected[i].rotation);
    view.centre = (*alignment * estimated_centres[i] - expected_centres[i]).norm();
    sum_squared += view.centre * view.centre;
    rotations_deg.push_back(view.rotation_deg);
    comparison.rotation_mean_deg += view.rotation_deg;
  }
  const auto num_views = static_cast<double>(comparison.views.size());
  comparison.centre_rmse = std::sqrt(sum_squared / num_views);
  comparison.centre_rmse_percent = 100.0 * comparison.centre_rmse / comparison.extent;
  comparison.rotation_mean_deg /= num_views;
  comparison.rotation_median_deg = Median(std::move(rotations_deg));
  comparison.relative_rotation_median_deg =
      MedianRelativeRotationDeg(estimated, expected, comparison.views);
  comparison.relative_direction_median_deg = MedianRelativeDirectionDeg(
      estimated, expected, Diameter(estimated_centres), comparison.extent);
  return comparison;
}

}  // namespace vgtw
