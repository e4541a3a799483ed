// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "bridge/predictions.h"
#include "scene/reconstruction.h"

#include <cstddef>

namespace vgtw {

struct TrackStageOptions {
  double keep_percent = 80.0;         // of a view's depths, by confidence, percent, (0, 100]
  double distractor_threshold = 0.5;  // depth on likelier distractors is not used; (0, 1]
  int num_threads = 0;
};

struct TrackStageSummary {
  size_t num_tracks = 0;             // that the database's verified matches form
  size_t num_points = 0;             // of these, placed by depth
  double ray_sigma_deg = 0.0;        // what angles between rays and points are, per axis
  double depth_scale_percent = 0.0;  // largest difference of a view's depth scale from 1
};

// Gives a model of poses the points of the database's verified matches: points2D are the keypoints,
// and each track lies where the depths of its views, put on one scale, say. The model's images must
// be those of the database. Throws Error if the database has no verified matches between them.
TrackStageSummary AddLiftedTracks(const PredictionReader& predictions,
                                  const ColmapDatabase& database,
                                  const TrackStageOptions& options,
                                  Reconstruction& reconstruction);

}  // namespace vgtw
