// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_alignment.h"

#include "scene/error.h"

#include <utility>

namespace vgtw {
namespace {

std::optional<AlignedPoses> AlignCentres(const std::vector<Rigid3d>& estimate,
                                         const std::vector<Rigid3d>& reference,
                                         const PoseAlignmentOptions& options) {
  const std::vector<Eigen::Vector3d> estimated = CameraCentres(estimate);
  const std::vector<Eigen::Vector3d> expected = CameraCentres(reference);
  const bool fixed_scale = options.type == PoseAlignment::kSE3;
  if (options.robust) {
    std::optional<RobustSim3d> robust =
        EstimateSim3dRobust(estimated, expected, {.fixed_scale = fixed_scale});
    if (!robust) return std::nullopt;
    return AlignedPoses{robust->b_from_a, std::move(robust->is_inlier)};
  }
  const std::optional<Sim3d> alignment =
      EstimateSim3d(estimated, expected, /*weights=*/{}, fixed_scale);
  if (!alignment) return std::nullopt;
  return AlignedPoses{*alignment, std::vector<bool>(estimate.size(), true)};
}

}  // namespace

void PoseAlignmentOptions::Check() const {
  VGTW_CHECK(!robust || type == PoseAlignment::kSE3 || type == PoseAlignment::kSim3,
             "PoseAlignmentOptions::robust needs a type that is estimated, SE3 or Sim3");
}

std::optional<AlignedPoses> AlignPoses(const std::vector<Rigid3d>& estimate,
                                       const std::vector<Rigid3d>& reference,
                                       const PoseAlignmentOptions& options) {
  options.Check();
  VGTW_CHECK(estimate.size() == reference.size(), "one pose of each view in both");
  const std::vector<bool> all(estimate.size(), true);
  switch (options.type) {
    case PoseAlignment::kNone:
      return AlignedPoses{{}, all};
    case PoseAlignment::kFirstCamera: {
      if (estimate.empty()) return std::nullopt;
      const Rigid3d reference_from_estimate = Inverse(reference.front()) * estimate.front();
      return AlignedPoses{
          {1.0, reference_from_estimate.rotation, reference_from_estimate.translation}, all};
    }
    case PoseAlignment::kSE3:
    case PoseAlignment::kSim3:
      break;
  }
  return AlignCentres(estimate, reference, options);
}

std::string AlignmentText(const PoseAlignmentOptions& options) {
  const std::string robustly = options.robust ? "robustly " : "";
  switch (options.type) {
    case PoseAlignment::kNone:
      return "not aligned";
    case PoseAlignment::kFirstCamera:
      return "aligned on the first camera";
    case PoseAlignment::kSE3:
      return robustly + "SE3-aligned";
    case PoseAlignment::kSim3:
      break;
  }
  return robustly + "Sim3-aligned";
}

std::vector<Eigen::Vector3d> CameraCentres(const std::vector<Rigid3d>& cams_from_world) {
  std::vector<Eigen::Vector3d> centres;
  centres.reserve(cams_from_world.size());
  for (const Rigid3d& cam_from_world : cams_from_world) {
    centres.push_back(OriginInSource(cam_from_world));
  }
  return centres;
}

}  // namespace vgtw
