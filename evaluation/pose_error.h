// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/pair_accuracy.h"
#include "evaluation/pose_alignment.h"
#include "scene/named_pose.h"
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
  bool is_inlier = true;  // of a robust alignment
  // What was compared, both in the reference's world.
  Rigid3d estimated_cam_from_world;
  Rigid3d expected_cam_from_world;
};

// Poses of an estimate against a reference. Law: a rigid motion of the whole estimate changes
// nothing if it is aligned by kFirstCamera or kSE3, a similarity nothing by kSim3. Memory and time
// grow with the square of the number of views.
struct PoseComparison {
  PoseAlignmentOptions alignment;
  std::vector<ViewPoseError> views;  // common to both, in the order of the reference
  std::vector<std::string> missing;  // in the reference only, in its order
  Sim3d reference_from_estimate;
  double extent = 0.0;               // diameter of all the reference's centres, scene units
  double centre_rmse = 0.0;          // "ATE", scene units of the reference
  double centre_rmse_percent = 0.0;  // of the extent
  double rotation_mean_deg = 0.0;    // after alignment
  double rotation_median_deg = 0.0;
  std::vector<PairError> pairs;  // of common views, alignment-free
  // Medians over the pairs, the latter of those that have a direction; NaN without any.
  double relative_rotation_median_deg = 0.0;
  double relative_direction_median_deg = 0.0;
};

// Returns nullopt with fewer than 2 common views, or where AlignPoses does.
std::optional<PoseComparison> ComparePoses(const std::vector<NamedPose>& estimate,
                                           const std::vector<NamedPose>& reference,
                                           const PoseAlignmentOptions& alignment = {});

// The same in the order of names.
std::optional<PoseComparison> ComparePoses(const std::map<std::string, Rigid3d>& estimate,
                                           const std::map<std::string, Rigid3d>& reference,
                                           const PoseAlignmentOptions& alignment = {});

}  // namespace vgtw
