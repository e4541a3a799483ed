// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_error.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Core>

namespace vgtw {
namespace {

constexpr size_t kMinViews = 2;  // for a pair

double MedianOrNan(std::vector<double> values) {
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : Median(std::move(values));
}

struct CommonViews {
  std::vector<std::string> names;
  std::vector<Rigid3d> estimate;
  std::vector<Rigid3d> reference;
  std::vector<std::string> missing;
};

CommonViews FindCommonViews(const std::vector<NamedPose>& estimate,
                            const std::vector<NamedPose>& reference) {
  std::map<std::string, const Rigid3d*> estimate_by_name;
  for (const NamedPose& pose : estimate) {
    const bool is_new = estimate_by_name.emplace(pose.name, &pose.cam_from_world).second;
    VGTW_CHECK(is_new, "names are unique: " + pose.name);
  }
  CommonViews common;
  for (const NamedPose& pose : reference) {
    const auto found = estimate_by_name.find(pose.name);
    if (found == estimate_by_name.end()) {
      common.missing.push_back(pose.name);
      continue;
    }
    common.names.push_back(pose.name);
    common.estimate.push_back(*found->second);
    common.reference.push_back(pose.cam_from_world);
  }
  return common;
}

void CompareAlignedViews(const CommonViews& common,
                         const AlignedPoses& aligned,
                         PoseComparison& comparison) {
  double sum_squared = 0.0;
  std::vector<double> rotations_deg;
  for (size_t i = 0; i < common.names.size(); ++i) {
    ViewPoseError view;
    view.name = common.names[i];
    view.is_inlier = aligned.is_inlier[i];
    view.estimated_cam_from_world =
        TransformCamera(aligned.reference_from_estimate, common.estimate[i]);
    view.expected_cam_from_world = common.reference[i];
    view.rotation_deg =
        AngleBetweenDeg(view.estimated_cam_from_world.rotation, common.reference[i].rotation);
    view.centre = (aligned.reference_from_estimate * OriginInSource(common.estimate[i]) -
                   OriginInSource(common.reference[i]))
                      .norm();
    sum_squared += view.centre * view.centre;
    rotations_deg.push_back(view.rotation_deg);
    comparison.rotation_mean_deg += view.rotation_deg;
    comparison.views.push_back(std::move(view));
  }
  const auto num_views = static_cast<double>(common.names.size());
  comparison.centre_rmse = std::sqrt(sum_squared / num_views);
  comparison.centre_rmse_percent = 100.0 * comparison.centre_rmse / comparison.extent;
  comparison.rotation_mean_deg /= num_views;
  comparison.rotation_median_deg = Median(std::move(rotations_deg));
}

void SummarisePairs(PoseComparison& comparison) {
  std::vector<double> rotations_deg;
  std::vector<double> directions_deg;
  std::vector<std::vector<double>> rotations_deg_by_view(comparison.views.size());
  for (const PairError& pair : comparison.pairs) {
    rotations_deg.push_back(pair.rotation_deg);
    rotations_deg_by_view[pair.view1].push_back(pair.rotation_deg);
    rotations_deg_by_view[pair.view2].push_back(pair.rotation_deg);
    if (!std::isnan(pair.direction_deg)) directions_deg.push_back(pair.direction_deg);
  }
  for (size_t i = 0; i < comparison.views.size(); ++i) {
    comparison.views[i].relative_rotation_deg = Median(std::move(rotations_deg_by_view[i]));
  }
  comparison.relative_rotation_median_deg = Median(std::move(rotations_deg));
  comparison.relative_direction_median_deg = MedianOrNan(std::move(directions_deg));
}

std::vector<NamedPose> InOrderOfNames(
    const std::map<std::string, Rigid3d>& cam_from_world_by_name) {
  std::vector<NamedPose> poses;
  for (const auto& [name, cam_from_world] : cam_from_world_by_name) {
    poses.push_back({name, cam_from_world});
  }
  return poses;
}

}  // namespace

std::optional<PoseComparison> ComparePoses(const std::vector<NamedPose>& estimate,
                                           const std::vector<NamedPose>& reference,
                                           const PoseAlignmentOptions& alignment) {
  CommonViews common = FindCommonViews(estimate, reference);
  if (common.names.size() < kMinViews) return std::nullopt;
  const std::optional<AlignedPoses> aligned =
      AlignPoses(common.estimate, common.reference, alignment);
  if (!aligned) return std::nullopt;

  PoseComparison comparison;
  comparison.alignment = alignment;
  comparison.reference_from_estimate = aligned->reference_from_estimate;
  std::vector<Rigid3d> all_expected;
  for (const NamedPose& pose : reference) all_expected.push_back(pose.cam_from_world);
  comparison.extent = Diameter(CameraCentres(all_expected));
  CompareAlignedViews(common, *aligned, comparison);
  comparison.pairs = ComputePairErrors(common.estimate, common.reference);
  SummarisePairs(comparison);
  comparison.missing = std::move(common.missing);
  return comparison;
}

std::optional<PoseComparison> ComparePoses(const std::map<std::string, Rigid3d>& estimate,
                                           const std::map<std::string, Rigid3d>& reference,
                                           const PoseAlignmentOptions& alignment) {
  return ComparePoses(InOrderOfNames(estimate), InOrderOfNames(reference), alignment);
}

}  // namespace vgtw
