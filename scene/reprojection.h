// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"

#include <cstddef>
#include <optional>

namespace vgtw {

// |projection - point2D| in pixels of one observation; nullopt if the point is behind the camera.
std::optional<double> ReprojectionError(const Reconstruction& reconstruction,
                                        const Image& image,
                                        const Point2D& point2D);

// Over all observations of all points. COLMAP's own figures go stale after its bundle_adjuster and
// explode with one point behind a camera, hence these.
struct ReprojectionStats {
  size_t num_images = 0;
  size_t num_points3D = 0;
  size_t num_observations = 0;
  size_t num_behind_camera = 0;  // not part of the pixel figures
  double median_px = 0.0;
  double mean_px = 0.0;
  double p90_px = 0.0;
  double mean_track_length = 0.0;
};
ReprojectionStats ComputeReprojectionStats(const Reconstruction& reconstruction);

// Sets Point3D::error to the mean error of its observations in front of their cameras, -1 if there
// are none.
void UpdatePointError(const Reconstruction& reconstruction, Point3D& point);
void UpdatePointErrors(Reconstruction& reconstruction);

}  // namespace vgtw
