// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vgtw {

// A similarity b_from_a:  x_in_b = scale * (rotation * x_in_a) + translation, scale > 0.
struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_a) const {
    return scale * (rotation * point_in_a) + translation;
  }
};

// c_from_a = c_from_b * b_from_a.
Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a);

Sim3d Inverse(const Sim3d& b_from_a);

// The same camera in another world: cam_from_b such that a point moved by b_from_a projects to the
// same pixel. Depths in the camera grow by b_from_a.scale.
Rigid3d TransformCamera(const Sim3d& b_from_a, const Rigid3d& cam_from_a);

// Minimises  sum_i w_i |points_in_b[i] - b_from_a * points_in_a[i]|^2  in closed form; weights may
// be empty (all 1). With `fixed_scale` among the rigid motions, of scale 1.
// Returns nullopt if fewer than 3 points have weight or if they are collinear (rank of the
// covariance < 2), where the rotation is undetermined.
// Source: S. Umeyama, Least-squares estimation of transformation parameters between two point
// patterns, PAMI 1991; weights as in the weighted mean and covariance.
std::optional<Sim3d> EstimateSim3d(const std::vector<Eigen::Vector3d>& points_in_a,
                                   const std::vector<Eigen::Vector3d>& points_in_b,
                                   const std::vector<double>& weights = {},
                                   bool fixed_scale = false);

struct RobustSim3dOptions {
  // Distance in b (scene units) under which a pair is an inlier. 0 = taken from the data: 2.5 times
  // the scaled median absolute residual of the best hypothesis (least median of squares).
  double max_residual = 0.0;
  int max_iterations = 1000;
  bool fixed_scale = false;  // only rigid motions
  uint64_t seed = 0;

  void Check() const;
};

struct RobustSim3d {
  Sim3d b_from_a;
  std::vector<bool> is_inlier;  // one per pair
  double max_residual = 0.0;    // the threshold that was used, in b
};

// Minimal samples of 3 (all of them when there are few pairs, else random by seed), scored by the
// threshold or by least median, then re-estimated from the inliers until they do not change.
// Returns nullopt under the conditions of EstimateSim3d.
std::optional<RobustSim3d> EstimateSim3dRobust(const std::vector<Eigen::Vector3d>& points_in_a,
                                               const std::vector<Eigen::Vector3d>& points_in_b,
                                               const RobustSim3dOptions& options = {});

}  // namespace vgtw
