// SPDX-License-Identifier: BSD-3-Clause
#include "refine/refine_round.h"

#include "refine/filter.h"
#include "scene/reprojection.h"

#include <algorithm>

namespace vgtw {
namespace {

// Relative decrease of the cost per iteration at which an adjustment ends. What lies in the slow
// valley of focal length against depth is left to rounds with final limits.
constexpr double kCoarseTolerance = 1e-4;
constexpr double kFineTolerance = 1e-7;
constexpr double kMaxMedians = 6.0;

std::vector<Track> WithoutImages(const std::vector<Track>& tracks, const std::set<ImageId>& held) {
  if (held.empty()) return tracks;
  std::vector<Track> rest;
  for (const Track& track : tracks) {
    Track& elements = rest.emplace_back();
    for (const TrackElement& element : track) {
      if (!held.contains(element.image_id)) elements.push_back(element);
    }
    if (elements.size() < 2) rest.pop_back();
  }
  return rest;
}

// Images that too few observations tie down go, until all that stay are tied down.
void DropWeakImages(int min_num_observations, Reconstruction& model) {
  for (bool is_done = false; !is_done;) {
    is_done = true;
    for (const auto& [id, num] : NumSupportingObservations(model)) {
      if (num >= static_cast<size_t>(min_num_observations)) continue;
      for (uint32_t idx = 0; idx < model.images.at(id).points2D.size(); ++idx) {
        if (!model.images.at(id).points2D[idx].HasPoint3D()) continue;
        RemoveObservation(model, {id, idx});
        is_done = false;
      }
    }
  }
}

}  // namespace

void RoundLimits::Tighten(double median_px) {
  max_error_px = std::min(max_error_px, std::max(kMaxMedians * median_px, final_px));
}

RoundOutcome RunRefineRound(const RefineModelOptions& options,
                            const std::vector<Track>& tracks,
                            const std::set<ImageId>& held,
                            const RoundLimits& limits,
                            Reconstruction& model) {
  RoundOutcome outcome;
  RoundLimits current = limits;
  TriangulateTracks({limits.max_error_px, options.min_angle_deg, options.num_threads},
                    WithoutImages(tracks, held),
                    model);
  for (int pass = 0; pass < 2; ++pass) {
    DropWeakImages(options.min_num_observations, model);
    outcome.num_supporting = NumSupportingObservations(model);
    const bool is_fine = limits.IsFinal() && pass == 1;
    BundleAdjustmentOptions adjustment;
    adjustment.loss_scale_px = std::max(1.0, ComputeReprojectionStats(model).median_px);
    adjustment.refine_focal_length = options.refine_focal_length;
    adjustment.refine_principal_point = options.refine_principal_point;
    // Distortion is released once poses are near: before that it would soak up their errors.
    adjustment.refine_extra_params = options.refine_extra_params && (limits.IsFinal() || pass == 1);
    adjustment.function_tolerance = is_fine ? kFineTolerance : kCoarseTolerance;
    adjustment.num_threads = options.num_threads;
    outcome.adjustment = AdjustBundle(adjustment, model);
    if (!outcome.adjustment.success) return {};
    outcome.median_px = ComputeReprojectionStats(model).median_px;
    current.Tighten(outcome.median_px);
    FilterObservations({current.max_error_px, options.min_angle_deg}, model);
  }
  DropWeakImages(options.min_num_observations, model);
  outcome.num_supporting = NumSupportingObservations(model);
  for (const auto& [id, num] : outcome.num_supporting) {
    if (num > 0) outcome.adjusted.insert(id);
  }
  return outcome;
}

std::map<ImageId, size_t> NumSupportingObservations(const Reconstruction& model) {
  const size_t min_track_length = model.images.size() < 3 ? 2 : 3;
  std::map<ImageId, size_t> num_by_image;
  for (const auto& [id, image] : model.images) num_by_image[id] = 0;
  for (const auto& [id, point3D] : model.points3D) {
    if (point3D.track.size() < min_track_length) continue;
    for (const TrackElement& element : point3D.track) ++num_by_image[element.image_id];
  }
  return num_by_image;
}

}  // namespace vgtw
