// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/view_sketch.h"

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// A view sees a point of another one if it lies in front of it, inside its image, at about the
// depth that was measured there, and looks about the same from both. The defaults bear what
// predictions are wrong by: rotations of a degree or two, depths of some 10 %.
struct CovisibilityOptions {
  // Depths are similar if neither exceeds the other by more than this; in (0, 10].
  double max_relative_depth_difference = 0.4;
  // Depth measured this far away along x and y counts too, % of the longer side; in [0, 100].
  double position_error_percent = 2.0;
  // Largest angle between the rays of a point, above which features do not match; in (0, 180].
  double max_ray_angle_deg = 60.0;
  // Largest ratio of the sizes of a thing in the two images, relative to the images' sizes, above
  // which features do not match either; in [1, 1000].
  double max_size_ratio = 4.0;

  void Check() const;
};

struct ViewPair {
  size_t view_idx1 = 0;  // < view_idx2
  size_t view_idx2 = 0;
  double covisibility = 0.0;  // in (0, 1]
  double angle_deg = 0.0;     // median angle between the rays of the points that both see
};

// What pairs of views share. A view without points gets points spread over its image at 1/2, 1 and
// 2 times an assumed depth: the median of those views that know theirs, else AssumedDepth; where a
// view has no depth, what lands in its image is at a similar one. A view whose pose or camera has a
// fault shares nothing.
class Covisibility {
 public:
  // `sketches` must outlive this.
  Covisibility(const std::vector<ViewSketch>& sketches, const CovisibilityOptions& options);

  size_t num_views() const { return eyes_.size(); }
  const std::vector<Eigen::Vector3d>& PointsOf(size_t view_idx) const;
  // How much of the world the image's longer side spans at each of these points; <= 0 or NaN where
  // one is not in front. None of a view that shares nothing for a fault.
  const std::vector<double>& FootprintsOf(size_t view_idx) const;

  // Covisibility is the fraction of the points of one view that the other sees, the smaller one of
  // both directions: matches are pairs, so that the view that shares less bounds their share. (The
  // mean would rank a close-up inside a wide view over views of which half is common.) If only one
  // of the views has points of its own, theirs alone count. nullopt if nothing is shared. The order
  // of the views does not matter. Indices must differ.
  std::optional<ViewPair> Measure(size_t view_idx1, size_t view_idx2) const;

 private:
  // A view, prepared for many projections.
  struct Eye {
    bool is_usable = false;
    Eigen::Matrix3d rotation;  // cam_from_world
    Eigen::Vector3d translation;
    Eigen::Vector3d centre;
    double squared_ray_radius = 0.0;   // of the corners, the largest
    double footprint_per_depth = 0.0;  // longer side / focal length
    double position_error_px = 0.0;
    std::vector<Eigen::Vector3d> assumed_points;
    std::vector<double> footprints;
  };

  static Eye MakeEye(const View& view, double position_error_percent);
  double SceneDepth() const;
  bool HasOwnPoints(size_t view_idx) const;
  // Whether the image shows the point, as far as the map of depth tells.
  bool HasAtItsDepth(size_t view_idx, const Eigen::Vector3d& point_in_cam) const;
  // Fraction of the points of a view that another one sees; appends the cosines of their rays.
  double SeenFraction(size_t from_idx, size_t by_idx, std::vector<double>& cosines) const;

  const std::vector<ViewSketch>& sketches_;
  CovisibilityOptions options_;
  double min_cosine_ = -1.0;
  std::vector<Eye> eyes_;
};

}  // namespace vgtw
