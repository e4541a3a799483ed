// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/features.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct PairMatches {
  ImageId image_id1 = 0;
  ImageId image_id2 = 0;
  FeatureMatches matches;
};

// What is known of an image's keypoints beside their matches. A list is empty (nothing is known) or
// has an entry per keypoint.
struct TrackImage {
  std::vector<bool> is_excluded;            // not of the static scene; takes no part
  std::span<const Eigen::Vector2f> pixels;  // with `scales`: twins become one
  std::span<const float> scales;            // pixels
};

struct TrackOptions {
  // Shorter tracks are left out; >= 2.
  int min_track_length = 2;
  // SIFT gives a place several orientations, each a keypoint of its own. Keypoints of one image are
  // such twins if they lie within this distance (pixels, in [0, 10]) and their scales differ by at
  // most this factor (in [1, 2]).
  double max_twin_distance_px = 0.1;
  double max_twin_scale_factor = 1.01;

  void Check() const;
};

struct TrackSummary {
  size_t num_matches = 0;           // distinct ones that took part; twins counted as one
  size_t num_excluded_matches = 0;  // with an excluded keypoint; repeated ones count each time
  size_t num_twins = 0;             // matched keypoints that stand for another one
  size_t num_refused_matches = 0;   // would have put two keypoints of an image into a track
  size_t num_observations = 0;      // in all tracks
};

struct Tracks {
  // Each ascending, in the order of their first elements. Disjoint; a track has at most one
  // keypoint per image. Of twins the first matched one stands for all.
  std::vector<std::vector<TrackElement>> tracks;
  TrackSummary summary;
};

// Joins matched keypoints into tracks. The strongest matches are joined first: those that the most
// third keypoints confirm (matched with both ends), then those of the pair with the most matches.
// A match that would put two keypoints of one image into a track is refused, so that a few wrong
// matches between two tracks leave both as they are. The order of pairs and of matches does not
// matter, nor do repetitions. Memory is linear in the number of matches.
// Throws std::invalid_argument if a pair names one image twice, or a match a keypoint that the
// lists of its image lack.
Tracks BuildTracks(const std::vector<PairMatches>& pairs,
                   const std::map<ImageId, TrackImage>& images = {},
                   const TrackOptions& options = {});

}  // namespace vgtw
