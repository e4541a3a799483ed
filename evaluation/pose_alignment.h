// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"
#include "scene/sim3d.h"

#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// How an estimate is moved into the world of its reference before it is compared.
enum class PoseAlignment {
  kNone,         // not at all: both are in the same world
  kFirstCamera,  // rigid motion that gives the first camera the reference's pose
  kSE3,          // best rigid motion of the camera centres
  kSim3          // best similarity of the camera centres (Umeyama 1991)
};

struct PoseAlignmentOptions {
  PoseAlignment type = PoseAlignment::kSim3;
  // Least median of squares, then least squares on the inliers (EstimateSim3dRobust): up to half of
  // the views may be anywhere. For kSE3 and kSim3 only.
  bool robust = false;

  void Check() const;
};

struct AlignedPoses {
  Sim3d reference_from_estimate;
  std::vector<bool> is_inlier;  // one per view; all of them unless robust
};

// Views in the same order in both. Deterministic.
// Returns nullopt where the motion is undetermined: no view for kFirstCamera, fewer than 3 or
// collinear centres for kSE3 and kSim3.
std::optional<AlignedPoses> AlignPoses(const std::vector<Rigid3d>& estimate,
                                       const std::vector<Rigid3d>& reference,
                                       const PoseAlignmentOptions& options = {});

// For figures: "not aligned", "aligned on the first camera", "SE3-aligned", "Sim3-aligned",
// "robustly Sim3-aligned".
std::string AlignmentText(const PoseAlignmentOptions& options);

std::vector<Eigen::Vector3d> CameraCentres(const std::vector<Rigid3d>& cams_from_world);

}  // namespace vgtw
