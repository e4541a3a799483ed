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

// One robust adjustment at the scale of the model's own error, then a filter.
BundleAdjustmentSummary AdjustAndFilter(const RefineRoundsOptions& options,
                                        bool refine_extra_params,
                                        double max_error_px,
                                        Reconstruction& model) {
  BundleAdjustmentOptions adjustment;
  adjustment.loss_scale_px = std::max(1.0, ComputeReprojectionStats(model).median_px);
  adjustment.refine_extra_params = refine_extra_params;
  adjustment.num_threads = options.num_threads;
  adjustment.fixed_images = WeakImages(model, options.min_num_observations);
  const BundleAdjustmentSummary summary = AdjustBundle(adjustment, model);
  FilterOptions filter;
  filter.max_reprojection_error_px = max_error_px;
  FilterObservations(filter, model);
  return summary;
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
  const double seed_max_error_px =
      std::max(kFinalMaxErrorPx, PixelsOfAngle(seed, kSeedMaxErrorDeg));
  double max_error_px = seed_max_error_px;
  RefineRoundsResult result;
  ProgressDisplay display("refine");
  for (int round = 0; round < options.num_rounds; ++round) {
    const Reconstruction& poses = round == 0 ? seed : result.refined;
    std::optional<Reconstruction> model = Triangulate(colmap, input, poses, max_error_px);
    if (!model) {
      if (round == 0) return std::nullopt;
      break;
    }
    if (round == 0) result.feedforward = *model;
    const bool is_last = round + 1 == options.num_rounds;
    // Twice: the first pass finds the poses, the second sharpens them without what it dropped.
    // Distortion is released once poses are near: before that it would soak up their errors.
    const bool releases_lens = options.refine_extra_params && round > 0;
    AdjustAndFilter(options, releases_lens, is_last ? kFinalMaxErrorPx : max_error_px, *model);
    const double median_px = ComputeReprojectionStats(*model).median_px;
    max_error_px = std::clamp(6.0 * median_px, kFinalMaxErrorPx, max_error_px);
    result.rounds.push_back(AdjustAndFilter(
        options, options.refine_extra_params, is_last ? kFinalMaxErrorPx : max_error_px, *model));
    result.refined = std::move(*model);
    display.Callback()(round + 1, options.num_rounds);
  }
  for (const ImageId image_id : WeakImages(result.refined, options.min_num_observations)) {
    result.held_views.push_back(result.refined.images.at(image_id).name);
  }
  UpdatePointErrors(result.refined);
  return result;
}

}  // namespace vgtw
