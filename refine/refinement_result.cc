// SPDX-License-Identifier: BSD-3-Clause
// What became of the views, for people.
#include "refine/refinement.h"

#include <algorithm>

namespace vgtw {

bool HasMoved(const Rigid3d& before, const Rigid3d& after) {
  return before.translation != after.translation ||
         before.rotation.coeffs() != after.rotation.coeffs();
}

void Refinement::DescribeViews(RefineModelResult& result) const {
  const auto supporting = NumSupportingObservations(result.refined);
  const auto num_held_out = judge_.NumObservations();
  const auto before = judge_.MeanPxByImage(seed_errors_);
  const auto after = judge_.MeanPxByImage(good_.errors);
  for (const auto& [id, image] : result.refined.images) {
    const Rigid3d& seed_pose = seed_.images.at(id).cam_from_world;
    RefinedView& view = result.views[id];
    view.name = image.name;
    view.num_supporting = supporting.at(id);
    view.num_observations = static_cast<size_t>(
        std::count_if(image.points2D.begin(), image.points2D.end(), [](const Point2D& point2D) {
          return point2D.HasPoint3D();
        }));
    if (num_held_out.contains(id)) {
      view.num_held_out = num_held_out.at(id);
      view.held_out_before_px = before.at(id);
      view.held_out_after_px = after.at(id);
    }
    view.turn_deg = AngleBetweenDeg(seed_pose.rotation, image.cam_from_world.rotation);
    view.move = (OriginInSource(seed_pose) - OriginInSource(image.cam_from_world)).norm();
    const auto rejected = rejected_.find(id);
    if (HasMoved(seed_pose, image.cam_from_world)) {
      view.outcome = ViewOutcome::kRefined;
    } else if (rejected != rejected_.end()) {
      view.outcome = ViewOutcome::kRejected;
      view.reason = rejected->second;
    } else if (view.num_supporting < static_cast<size_t>(options_.min_num_observations)) {
      view.reason = TooFewSupporting(view.num_supporting);
    } else {
      view.reason = "no round lowered the error of tracks held out";
    }
  }
}

std::string Refinement::TooFewSupporting(size_t num) const {
  return std::to_string(num) + " observations of points that three photos see, at least " +
         std::to_string(options_.min_num_observations) + " are needed";
}

void Refinement::AddUncertainty(RefineModelResult& result) const {
  BundleAdjustmentOptions adjustment = AdjustmentOf(options_, result.refined, priors_);
  for (const auto& [id, view] : result.views) {
    if (view.outcome != ViewOutcome::kRefined) adjustment.fixed_images.insert(id);
  }
  result.uncertainty = EstimateUncertainty(adjustment, result.refined);
  for (auto& [id, view] : result.views) {
    const auto pose = result.uncertainty.poses.find(id);
    if (view.outcome != ViewOutcome::kRefined || pose == result.uncertainty.poses.end()) continue;
    view.sigma_rotation_deg = pose->second.rotation_deg;
    view.sigma_centre = pose->second.centre;
  }
}

}  // namespace vgtw
