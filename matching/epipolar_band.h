// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/feature_grid.h"
#include "scene/camera.h"

#include <optional>

#include <Eigen/Core>

namespace vgtw {

// Where in view 2 a feature of view 1 may lie: pixels whose Sampson distance from the epipolar line
// is at most `max_error_px`, within `radius_px` of an expected pixel. For fewer candidates than a
// disc holds; a little too wide, because the line is that of the undisturbed feature of view 1, and
// lenses bend it.
class EpipolarBand {
 public:
  // ray2^T E ray1 = 0 for rays; x2^T F x1 = 0 for pixels.
  static EpipolarBand OfRays(const Eigen::Matrix3d& E, const Camera& camera2, double max_error_px);
  static EpipolarBand OfPixels(const Eigen::Matrix3d& F, double max_error_px);

  bool is_of_rays() const { return camera2_ != nullptr; }

  // `x1` is the ray or the pixel of the feature. nullopt if the line passes by farther away than
  // the radius.
  std::optional<Capsule> Around(const Eigen::Vector2f& expected_pixel,
                                float radius_px,
                                const Eigen::Vector2d& x1) const;

 private:
  EpipolarBand(const Eigen::Matrix3d& matrix, const Camera* camera2, double max_error_px)
      : matrix_(matrix), camera2_(camera2), max_error_px_(max_error_px) {}

  Eigen::Matrix3d matrix_;
  const Camera* camera2_;  // nullptr: x2 are pixels
  double max_error_px_;
};

}  // namespace vgtw
