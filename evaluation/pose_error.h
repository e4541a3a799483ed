// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"
#include "scene/sim3d.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct ViewPoseError {
  std::string name;
  double rotation_deg = 0.0;  // of cam_from_world, after alignment
  double centre = 0.0;        // distance after alignment, scene units of the reference
  // Median error of the rotations from this view to the others: alignment-free, so that it stays
  // small where close or collinear centres leave the alignment's rotation to noise.
  double relative_rotation_deg = 0.0;
};

// Poses of an estimate against a reference, Sim3-aligned on the camera centres (Umeyama over all
// common views). Law: a similarity applied to the whole estimate changes nothing. Memory and time
// grow with the square of the number of views.
struct PoseComparison {
  std::vector<ViewPoseError> views;  // common to both, sorted by name
  size_t num_missing = 0;            // in the reference only
  Sim3d reference_from_estimate;
  double extent = 0.0;               // diameter of all the reference's centres, scene units
  double centre_rmse = 0.0;          // "ATE", scene units of the reference
  double centre_rmse_percent = 0.0;  // of the extent
  double rotation_mean_deg = 0.0;    // after alignment
  double rotation_median_deg = 0.0;
  // Alignment-free, over all pairs of common views: error of cam2_from_cam1's rotation, and of the
  // direction from camera 1 (the first by name) to camera 2 in camera 1's frame, in [0, 180].
  // Pairs closer than 1e-9 of the extent have no direction and are left out of the latter.
  double relative_rotation_median_deg = 0.0;
  double relative_direction_median_deg = 0.0;
};

// Returns nullopt with fewer than 3 common views or collinear centres, where the alignment is
// undetermined.
std::optional<PoseComparison> ComparePoses(const std::map<std::string, Rigid3d>& estimate,
                                           const std::map<std::string, Rigid3d>& reference);

}  // namespace vgtw
