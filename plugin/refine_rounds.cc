// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_rounds.h"

#include "bridge/colmap_model.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "refine/filter.h"
#include "scene/error.h"
#include "scene/reprojection.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// COLMAP's own limit for observations of good poses.
constexpr double kFinalMaxErrorPx = 4.0;
// Feed-forward rotations are within a degree or two: this far off a true match may reproject.
constexpr double kSeedMaxErrorDeg = 2.5;

// Relative decrease of the cost per iteration at which an adjustment ends. What lies in the slow
// valley of focal length against depth is left to the last one.
constexpr double kCoarseTolerance = 1e-4;
constexpr double kFineTolerance = 1e-7;

// Pixels that an angle spans at the image centre of the longest lens.
double PixelsOfAngle(const Reconstruction& model, double angle_deg) {
  double focal_length = 0.0;
  for (const auto& [id, camera] : model.cameras) {
    focal_length = std::max(focal_length, camera.MeanFocalLength());
  }
  return focal_length * std::tan(angle_deg * std::numbers::pi / 180.0);
}

std::set<ImageId> WeakImages(const Reconstruction& model, int min_num_observations) {
  std::set<ImageId> weak;
  for (const auto& [id, num] : NumSupportingObservations(model)) {
    if (num < static_cast<size_t>(min_num_observations)) weak.insert(id);
  }
  return weak;
}

// The poses and cameras of a model without its points.
Reconstruction WithoutPoints(const Reconstruction& model) {
  Reconstruction bare = model;
  bare.points3D.clear();
  for (auto& [id, image] : bare.images) image.points2D.clear();
  return bare;
}

// The model without what the given images see. Held views take no part in the adjustment: as fixed
// cameras their few, often wrong, observations would turn all others around them.
Reconstruction WithoutObservationsOf(const std::set<ImageId>& image_ids, Reconstruction model) {
  for (const ImageId image_id : image_ids) {
    const size_t num_points2D = model.images.at(image_id).points2D.size();
    for (uint32_t idx = 0; idx < num_points2D; ++idx) {
      if (model.images.at(image_id).points2D[idx].HasPoint3D()) {
        RemoveObservation(model, {image_id, idx});
      }
    }
  }
  return model;
}

// Takes over cameras, poses and points; points that `adjusted` lacks stay where they are.
void CopyGeometry(const Reconstruction& adjusted, Reconstruction& model) {
  model.cameras = adjusted.cameras;
  for (auto& [id, image] : model.images) {
    image.cam_from_world = adjusted.images.at(id).cam_from_world;
  }
  for (const auto& [id, point3D] : adjusted.points3D) model.points3D.at(id).xyz = point3D.xyz;
  UpdateFrames(model);
}

// How one adjustment of a round goes about it.
struct Pass {
  bool refine_extra_params = false;
  double max_error_px = 0.0;  // of observations that stay
  double function_tolerance = 0.0;
};

// One robust adjustment at the scale of the model's own error, then a filter.
BundleAdjustmentSummary AdjustAndFilter(const RefineRoundsOptions& options,
                                        const std::set<ImageId>& held,
                                        const Pass& pass,
                                        Reconstruction& model) {
  BundleAdjustmentOptions adjustment;
  adjustment.loss_scale_px = std::max(1.0, ComputeReprojectionStats(model).median_px);
  adjustment.refine_extra_params = pass.refine_extra_params;
  adjustment.function_tolerance = pass.function_tolerance;
  adjustment.num_threads = options.num_threads;
  std::set<ImageId> left_out = WeakImages(model, options.min_num_observations);
  left_out.insert(held.begin(), held.end());
  Reconstruction adjusted = WithoutObservationsOf(left_out, model);
  const BundleAdjustmentSummary summary = AdjustBundle(adjustment, adjusted);
  CopyGeometry(adjusted, model);
  FilterOptions filter;
  filter.max_reprojection_error_px = pass.max_error_px;
  FilterObservations(filter, model);
  return summary;
}

// All rounds, from the first triangulation in result.feedforward to result.refined.
void RunRounds(const Colmap& colmap,
               const TriangulationInput& input,
               const RefineRoundsOptions& options,
               const std::set<ImageId>& held,
               double seed_max_error_px,
               RefineRoundsResult& result) {
  ProgressDisplay display("refine");
  double max_error_px = seed_max_error_px;
  result.rounds.clear();
  result.refined = result.feedforward;
  for (int round = 0; round < options.num_rounds; ++round) {
    Reconstruction model = result.refined;
    if (round > 0) {
      auto triangulated = Triangulate(colmap, input, model, max_error_px);
      if (!triangulated) return;
      model = std::move(*triangulated);
    }
    // Limits that are final already cannot become tighter by another round.
    const bool is_last =
        round + 1 == options.num_rounds || (round > 0 && max_error_px <= kFinalMaxErrorPx);
    // Twice: the first pass finds the poses, the second sharpens them without what it dropped.
    // Distortion is released once poses are near: before that it would soak up their errors.
    Pass pass = {options.refine_extra_params && round > 0,
                 is_last ? kFinalMaxErrorPx : max_error_px,
                 kCoarseTolerance};
    AdjustAndFilter(options, held, pass, model);
    const double median_px = ComputeReprojectionStats(model).median_px;
    max_error_px = std::clamp(6.0 * median_px, kFinalMaxErrorPx, max_error_px);
    pass = {options.refine_extra_params,
            is_last ? kFinalMaxErrorPx : max_error_px,
            is_last ? kFineTolerance : kCoarseTolerance};
    result.rounds.push_back(AdjustAndFilter(options, held, pass, model));
    result.refined = std::move(model);
    display.Callback()(is_last ? options.num_rounds : round + 1, options.num_rounds);
    if (is_last) break;
  }
}

// Why the outcome for an image cannot be kept; "" if it can.
std::string FindReasonToHold(const RefineRoundsOptions& options,
                             const Rigid3d& seed,
                             const Rigid3d& refined,
                             size_t num_supporting) {
  if (num_supporting < static_cast<size_t>(options.min_num_observations)) {
    return std::to_string(num_supporting) +
           " observations of points that three photos see, at least " +
           std::to_string(options.min_num_observations) + " are needed";
  }
  const double turn_deg = AngleBetweenDeg(seed.rotation, refined.rotation);
  if (turn_deg <= options.max_turn_deg) return "";
  return "refinement would turn it by " + FormatNumber(turn_deg, 1) + " deg, at most " +
         FormatNumber(options.max_turn_deg, 1) + " are believed";
}

bool HasMoved(const Rigid3d& a, const Rigid3d& b) {
  return a.translation != b.translation || a.rotation.coeffs() != b.rotation.coeffs();
}

}  // namespace

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

std::optional<Reconstruction> Triangulate(const Colmap& colmap,
                                          const TriangulationInput& input,
                                          const Reconstruction& seed,
                                          double max_error_px) {
  const fs::path seed_path = input.scratch / "seed";
  const fs::path output_path = input.scratch / "triangulated";
  fs::remove_all(output_path);
  fs::create_directories(output_path);
  WriteModelOptions overwrite;
  overwrite.overwrite = true;
  WriteModel(WithoutPoints(seed), seed_path, overwrite);
  const std::string max_error = FormatNumber(max_error_px, 3);
  // An angle of 2 degrees is COLMAP's default for creating points; wider limits go together.
  const double scale = std::max(1.0, max_error_px / kFinalMaxErrorPx);
  const std::string max_angle_deg = FormatNumber(std::min(2.0 * scale, 8.0), 3);
  colmap.Run(
      "point_triangulator",
      {{"database_path", input.database_path},
       {"image_path", input.image_path},
       {"input_path", seed_path},
       {"output_path", output_path},
       {"clear_points", "1"},
       {"Mapper.tri_ignore_two_view_tracks", "0"},
       {"Mapper.tri_create_max_angle_error", max_angle_deg},
       {"Mapper.tri_continue_max_angle_error", max_angle_deg},
       {"Mapper.tri_merge_max_reproj_error", max_error},
       {"Mapper.tri_complete_max_reproj_error", max_error},
       {"Mapper.filter_max_reproj_error", max_error},
       {"Mapper.num_threads", std::to_string(input.num_threads > 0 ? input.num_threads : -1)}},
      input.log_path);
  if (!IsModelFolder(output_path)) return std::nullopt;
  Reconstruction model = ReadModel(output_path);
  if (model.points3D.empty()) return std::nullopt;
  return model;
}

std::optional<RefineRoundsResult> RefineInRounds(const Colmap& colmap,
                                                 const TriangulationInput& input,
                                                 const Reconstruction& seed,
                                                 const RefineRoundsOptions& options) {
  VGTW_CHECK(options.num_rounds >= 1, "rounds of refinement");
  VGTW_CHECK(options.max_turn_deg > 0.0, "RefineRoundsOptions::max_turn_deg");
  const double max_error_px = std::max(kFinalMaxErrorPx, PixelsOfAngle(seed, kSeedMaxErrorDeg));
  auto triangulated = Triangulate(colmap, input, seed, max_error_px);
  if (!triangulated) return std::nullopt;
  RefineRoundsResult result;
  result.feedforward = std::move(*triangulated);
  std::map<ImageId, std::string> reasons;
  std::set<ImageId> held;
  for (bool must_repeat = true; must_repeat;) {
    RunRounds(colmap, input, options, held, max_error_px, result);
    must_repeat = false;
    const auto num_supporting = NumSupportingObservations(result.refined);
    for (const auto& [id, image] : result.refined.images) {
      const Rigid3d& before = result.feedforward.images.at(id).cam_from_world;
      const std::string reason =
          FindReasonToHold(options, before, image.cam_from_world, num_supporting.at(id));
      if (reason.empty() || !reasons.emplace(id, reason).second) continue;
      held.insert(id);
      must_repeat = must_repeat || HasMoved(before, image.cam_from_world);
    }
  }
  for (const auto& [id, reason] : reasons) {
    result.held_views.push_back({result.refined.images.at(id).name, reason});
  }
  UpdatePointErrors(result.refined);
  return result;
}

}  // namespace vgtw
