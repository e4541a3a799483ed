// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/bundle_adjustment.h"
#include "refine/gauge.h"
#include "refine/levenberg_marquardt.h"
#include "refine/prior_blocks.h"
#include "refine/reprojection_cost.h"
#include "scene/sim3d.h"

#include <array>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include <ceres/ceres.h>

namespace vgtw {

// What of a reconstruction takes part in its bundle adjustment, by dense indices.
struct BundleParticipants {
  struct Observation {
    size_t image_idx = 0;
    Eigen::Vector2d pixel;
  };

  std::vector<ImageId> image_ids;        // all images
  std::vector<size_t> num_observations;  // per image
  std::vector<Point3DId> point3D_ids;
  std::vector<std::vector<Observation>> observations;  // per point
};

// Points that two images see in front of them, with their observations in front.
BundleParticipants FindBundleParticipants(const Reconstruction& reconstruction);

// The least-squares problem with its own copies of all parameters, in a working frame whose origin
// is a camera and whose unit is the extent of the cameras: Ceres' damping and the gauge's held
// coordinate are well scaled there, however large the world's coordinates are.
class BundleProblem {
 public:
  // Keeps references to the arguments.
  BundleProblem(const BundleAdjustmentOptions& options,
                const Reconstruction& reconstruction,
                const BundleParticipants& participants);

  const Gauge& gauge() const { return gauge_; }
  int num_residuals() const { return problem_.NumResiduals(); }
  const ceres::Problem& problem() const { return problem_; }
  const ceres::LossFunction& loss() const { return *loss_; }  // of the observations
  const Sim3d& working_from_world() const { return working_from_world_; }
  const std::vector<std::array<double, kNumPoseParams>>& poses() const { return poses_; }
  const std::vector<Eigen::Vector3d>& points() const { return points_; }
  const std::map<CameraId, std::vector<double>>& params() const { return params_; }
  const PriorBlocks& priors() const { return *priors_; }

  LevenbergMarquardtSummary Solve();

  // Whether every parameter is finite and every camera usable.
  bool IsPossible() const;

  // Writes the solution; what was held stays bit-equal.
  void WriteTo(Reconstruction& reconstruction) const;

 private:
  void ChooseWorkingFrame();
  void CopyParameters();
  void AddResiduals();
  void AddPriors();
  void HoldPoses();
  void HoldIntrinsics();

  const BundleAdjustmentOptions& options_;
  const Reconstruction& reconstruction_;
  const BundleParticipants& participants_;
  PriorTies prior_ties_;
  Gauge gauge_;
  std::unique_ptr<ceres::LossFunction> loss_;  // one for all residuals
  ceres::Problem problem_;
  Sim3d working_from_world_;
  std::vector<std::array<double, kNumPoseParams>> poses_;
  std::vector<Eigen::Vector3d> points_;
  std::map<CameraId, std::vector<double>> params_;
  std::optional<PriorBlocks> priors_;
};

}  // namespace vgtw
