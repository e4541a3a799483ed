// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/depth_scales.h"
#include "matching/view_features.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct LiftOptions {
  // Views agree on a point if it lies within this factor times the sigma of their depth, and of
  // their rays; in [1, 100].
  double max_sigmas = 4.0;
  // Bounds of the sigma of rays (degrees), which is measured: what keypoints are good for, and the
  // angle between ray and point from which, whatever was measured, a view does not agree.
  // 0 < min_ray_sigma_deg <= max_error_deg <= 45.
  double min_ray_sigma_deg = 0.02;
  double max_error_deg = 10.0;
  // Relative sigma of depth: at least this, for views that agree may be wrong together, which
  // spread does not show; and where a view's spread is unknown; in (0, 1].
  double min_depth_sigma = 0.03;
  double default_depth_sigma = 0.05;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

struct LiftedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();  // world
  double sigma = 0.0;               // expected distance to the true point (rms), scene units
  double error_deg = 0.0;           // rms angle between rays and point
  std::vector<TrackElement> track;  // the elements whose rays agree, at least 2
};

struct LiftedTracks {
  std::vector<std::optional<LiftedPoint>> points;  // one per track
  size_t num_lifted = 0;
  // What the angles between rays and points are, poses and intrinsics being as they are, per axis;
  // max_sigmas times this, at most max_error_deg, was the limit.
  double ray_sigma_deg = 0.0;
};

// Start values of points from depth: each view says that the point lies on its ray (sigma grows
// with the distance) at scale * depth (sigma is the larger of the view's spread and
// min_depth_sigma, relative, smaller where the producer's confidence exceeds the view's median).
// The point is the most likely one under these, so that rays decide across and, where they meet at
// an angle, along each other; views beyond the limits have no weight. It starts from the best of
// what single views and pairs of views say, lest wrong depths or matches decide.
// A track stays unknown unless the rays of two views and of half of all agree, the point in front
// of them, and the depths of more than half of those that have one. Views without depth take part
// with their rays; elements whose image is not in `views` take none. `scales` may lack views, whose
// scale is 1. Throws std::invalid_argument if a track names a keypoint that its view lacks.
LiftedTracks LiftTracks(const std::map<ImageId, ViewFeatures>& views,
                        const std::vector<std::vector<TrackElement>>& tracks,
                        const DepthScales& scales,
                        const LiftOptions& options = {});

// Adds the lifted points, with ids behind those that exist, and lets the points2D of their tracks
// name them; errors are computed, colours are left to others. Elements whose image is missing or
// whose point2D has a point already are left out, and points with fewer than two others. Returns
// the number of new points. Throws std::invalid_argument if an image has too few points2D.
size_t AddPoints(const LiftedTracks& lifted, Reconstruction& reconstruction);

}  // namespace vgtw
