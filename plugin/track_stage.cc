// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/track_stage.h"

#include "matching/track_lifting.h"
#include "matching/tracks.h"
#include "plugin/database_tracks.h"
#include "plugin/progress.h"
#include "plugin/static_views.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace vgtw {
namespace {

// Keypoints with their depths; descriptors stay in the database.
std::map<ImageId, ViewFeatures> LoadViews(const PredictionReader& predictions,
                                          const ColmapDatabase& database,
                                          const TrackStageOptions& options,
                                          Reconstruction& reconstruction) {
  const std::map<std::string, size_t> idx_by_name = IndexByName(predictions);
  std::map<ImageId, ViewFeatures> views;
  ProgressDisplay display("depths");
  for (auto& [image_id, image] : reconstruction.images) {
    const size_t idx = idx_by_name.at(image.name);
    const StaticView static_view(predictions.Load(idx), options.distractor_threshold);
    View view = predictions.views()[idx];
    view.camera = reconstruction.cameras.at(image.camera_id);
    view.cam_from_world = image.cam_from_world;
    ViewFeatures& features = views[image_id];
    features = MakeViewFeatures(view,
                                {database.ReadKeypoints(image_id).value_or(Keypoints()), {}},
                                &static_view,
                                ConfidenceThreshold(static_view, options.keep_percent));
    image.points2D.assign(features.size(), {});
    for (size_t i = 0; i < features.size(); ++i) {
      image.points2D[i].xy = features.pixels[i].cast<double>();
    }
    display.Callback()(static_cast<int64_t>(views.size()),
                       static_cast<int64_t>(reconstruction.images.size()));
  }
  return views;
}

}  // namespace

TrackStageSummary AddLiftedTracks(const PredictionReader& predictions,
                                  const ColmapDatabase& database,
                                  const TrackStageOptions& options,
                                  Reconstruction& reconstruction) {
  const std::vector<PairMatches> pairs = ReadVerifiedMatches(database, reconstruction);
  const std::map<ImageId, ViewFeatures> views =
      LoadViews(predictions, database, options, reconstruction);
  std::map<ImageId, TrackImage> images;
  for (const auto& [image_id, view] : views) images[image_id] = {{}, view.pixels, view.scales};
  const Tracks tracks = BuildTracks(pairs, images);
  const DepthScales scales = EstimateDepthScales(views, tracks.tracks);
  LiftOptions lift;
  lift.num_threads = options.num_threads;
  const LiftedTracks lifted = LiftTracks(views, tracks.tracks, scales, lift);
  TrackStageSummary summary;
  summary.num_tracks = tracks.tracks.size();
  summary.num_points = AddPoints(lifted, reconstruction);
  summary.ray_sigma_deg = lifted.ray_sigma_deg;
  for (const auto& [image_id, scale] : scales) {
    summary.depth_scale_percent =
        std::max(summary.depth_scale_percent, 100.0 * std::abs(scale.scale - 1.0));
  }
  return summary;
}

}  // namespace vgtw
