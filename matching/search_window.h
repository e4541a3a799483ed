// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/feature_grid.h"
#include "matching/view_features.h"
#include "scene/rigid3d.h"

#include <optional>

namespace vgtw {

// Standard deviations of the errors of a prediction.
struct PredictionUncertainty {
  double rotation_deg = 1.0;  // between two views
  double centre = 0.0;        // of the vector between two centres, scene units
  double focal = 0.03;        // relative, per view
  double depth = 0.06;        // relative, per pixel

  void Check() const;
};

// Where the counterpart of a feature is to be looked for.
struct SearchWindow {
  Capsule capsule;                                   // pixels of the other view
  Eigen::Vector2f centre = Eigen::Vector2f::Zero();  // image of the middle depth
  float scale_ratio = 0.0f;  // its scale in the other view / its own; 0 = unknown
};

// Windows in view 2 for features of view 1. With X = R (d ray1) + t the counterpart lies at
// project(X); the window is the image of the depths d exp(+-k sigma_depth), widened by
//   k |(f2 sigma_rotation (1 + |ray2|^2), f2 / z2 sigma_centre, sigma_focal (|q| + f2/f1 |p|))|
// with p and q relative to the principal points and k = num_sigmas. A feature of unknown depth gets
// the image of all depths in which the views' known depths lie.
class WindowPredictor {
 public:
  WindowPredictor(const ViewFeatures& view1,
                  const ViewFeatures& view2,
                  const PredictionUncertainty& uncertainty,
                  double num_sigmas);

  // nullopt if the feature cannot be seen in view 2.
  std::optional<SearchWindow> WindowOf(size_t idx1) const;

 private:
  struct DepthRange {
    double nearest, farthest;
  };
  std::optional<DepthRange> InFrontOfView2(const Eigen::Vector3d& ray, DepthRange range) const;
  double Radius(const Eigen::Vector2d& pixel1,
                const Eigen::Vector2d& pixel2,
                const Eigen::Vector3d& point_in_cam2) const;
  // How far the image of the ray leaves the axis, in pixels.
  float Bow(const Eigen::Vector3d& ray, const DepthRange& range, const Capsule& axis) const;
  bool IsOutside(const Capsule& capsule) const;

  const ViewFeatures& view1_;
  const Camera& camera2_;
  Rigid3d cam2_from_cam1_;
  PredictionUncertainty uncertainty_;
  double num_sigmas_;
  DepthRange known_depths_;
};

}  // namespace vgtw
