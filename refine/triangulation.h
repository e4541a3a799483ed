// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <cstddef>
#include <map>
#include <vector>

namespace vgtw {

// Keypoints that are believed to be one point of the scene.
using Track = std::vector<TrackElement>;

struct TriangulationOptions {
  double max_error_px = 4.0;   // of observations that join a point; > 0
  double min_angle_deg = 1.5;  // between the rays of some two of its observations; in [0, 90)
  int num_threads = 0;         // 0 = all cores
  // Images whose observations have another limit: their poses are worse known, so that these count
  // for less, too. Each > 0.
  std::map<ImageId, double> max_error_px_by_image = {};

  double MaxErrorPx(ImageId image_id) const;
  void Check() const;
};

struct TriangulationSummary {
  size_t num_tracks = 0;
  size_t num_points3D = 0;
  size_t num_observations = 0;
};

// Replaces the points of `model` by those of the tracks, under the poses and intrinsics that it
// has. A point is the robust optimum of reprojection errors (Cauchy), in units of their limits,
// from the best of what pairs of rays say, and observes what then lies within its limit, in front,
// one keypoint per image. What is left of the track may be another point, as a wrong match joins
// two. So points are a function of tracks, poses and intrinsics alone: with better poses tracks
// grow again that were cut before. A point that the model has already is one more start for the
// tracks of its observations. Colours are kept where a new point shares an observation with an old
// one. Throws std::invalid_argument if a track names what the model lacks.
TriangulationSummary TriangulateTracks(const TriangulationOptions& options,
                                       const std::vector<Track>& tracks,
                                       Reconstruction& model);

// The tracks of the model's own points.
std::vector<Track> TracksOf(const Reconstruction& model);

}  // namespace vgtw
