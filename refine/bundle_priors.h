// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"
#include "scene/sim3d.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What is known of a solution besides its pixels, for bundle adjustment. Each group is switched on
// by having entries; every entry has its own sigma. Poses and centres are given in a world of their
// own, the *reference* world (of a network, of GPS), to which  x_ref = reference_from_world * x
// leads from the model's.
enum class PriorWorld {
  kFree,  // reference_from_world is unknown (7 parameters more): the priors tell shape, not scale
  kSame   // it is the identity: the model has been moved there, and the gauge is the priors'
};

struct PosePrior {
  Rigid3d cam_from_reference;
  double rotation_sigma_deg = 0.2;  // per axis; > 0
  double centre_sigma = 0.0;        // per axis, units of the reference world; > 0
};

// Residuals:  log(R R_s^T R_prior^T) / sigma  and  (c_prior - reference_from_world * c) / sigma.
struct PosePriors {
  std::map<ImageId, PosePrior> by_image;
  PriorWorld world = PriorWorld::kFree;
};

struct CentrePrior {
  Eigen::Vector3d centre_in_reference = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma = Eigen::Vector3d::Zero();  // per axis, units of the reference world; > 0
};

// Known centres (GPS). Residual:  (c_prior - reference_from_world * c) / sigma.
struct CentrePriors {
  std::map<ImageId, CentrePrior> by_image;
  PriorWorld world = PriorWorld::kFree;
};

// Residual:  log(f / f_prior) / sigma,  of both focal lengths where the model has two.
struct FocalPrior {
  double focal_length_x = 0.0;  // pixels; > 0
  double focal_length_y = 0.0;  // pixels; > 0. A model with one f takes the mean
  double log_sigma = 0.05;      // about the relative sigma; > 0
};

struct DepthPrior {
  uint32_t point2D_idx = 0;
  double depth = 0.0;      // z-depth as predicted, any unit; > 0
  double log_sigma = 0.0;  // about the relative sigma, larger where confidence is low; > 0
};

// Residual:  log((z / s - t m) / (e^v D)) / sigma,  that is  z = s (e^v D + t m),  with the point's
// depth z in the camera, the predicted depth D, their median m in the view, one unknown scale s of
// all views, and per view a scale e^v and a shift t. The sigmas of v and t keep views with few
// depths determined. (The error is measured in D: in z, where a shift dilutes it, the least cost
// would be at shifts that flatten the scene.)
struct DepthPriors {
  std::map<ImageId, std::vector<DepthPrior>> by_image;
  bool free_view_scales = true;
  bool free_view_shifts = true;
  double view_scale_log_sigma = 0.1;  // of v; > 0
  double view_shift_sigma = 0.1;      // of t; > 0
};

struct BundlePriors {
  PosePriors poses;
  CentrePriors centres;
  std::map<CameraId, FocalPrior> focal_lengths;
  DepthPriors depths;
  // Sigma of a coordinate of a reprojection residual: a prior that is one sigma off costs as much
  // as a pixel coordinate that is.
  double sigma_px = 1.0;
  // Residual (sigmas) at which the Cauchy loss of all priors departs from the square: wrong priors
  // are ignored. > 0.
  double loss_scale = 3.0;

  void Check() const;
};

// One group after an adjustment.
struct PriorGroupSummary {
  size_t num_priors = 0;          // that took part
  std::vector<double> residuals;  // their scalar residuals at the end, in sigmas
  double initial_rms = 0.0;       // in sigmas
  double final_rms = 0.0;
  std::string message;  // why the group took no part, or ""
};

struct BundlePriorsSummary {
  PriorGroupSummary rotations;     // of `poses`
  PriorGroupSummary pose_centres;  // of `poses`
  PriorGroupSummary centres;
  PriorGroupSummary focal_lengths;
  PriorGroupSummary depths;
  // From the world of the adjusted model; nullopt where the group took no part. Applied to the
  // model they move it into the reference world, known centres so to metric scale.
  std::optional<Sim3d> poses_reference_from_world;
  std::optional<Sim3d> centres_reference_from_world;
  std::optional<double> depth_scale;  // s: scene units per unit of the predicted depths
};

// The similarity that leads the model's cameras onto the priors, robustly (fewer than half of them
// may be wrong). nullopt if it is undetermined: fewer than two images with a pose, or all at one
// place; fewer than three centres, or all on a line.
std::optional<Sim3d> EstimateReferenceFromWorld(const PosePriors& priors,
                                                const std::map<ImageId, Rigid3d>& cam_from_world);
std::optional<Sim3d> EstimateReferenceFromWorld(const CentrePriors& priors,
                                                const std::map<ImageId, Rigid3d>& cam_from_world);

struct MeasuredSigmaOptions {
  double min_factor = 0.1;  // > 0
  // The stated sigma counts like so many measured residuals; >= 0.
  double num_stated_residuals = 10.0;
  // Share of their variance that the residuals keep, in [0, 1]: PriorRedundancies of
  // refine/uncertainty.h. Without it priors that outweigh the pixels seem better than they are.
  double redundancy = 1.0;

  void Check() const;
};

// By which factor a group's stated sigmas should be multiplied, given its residuals in sigmas:
//   sqrt((r n m^2 + n_0) / (r n + n_0)),  m = 1.4826 median |residual| / sqrt(r) >= min_factor,
// n their number and r their redundancy. Repeated with the new sigmas it converges in a few rounds.
double MeasuredSigmaFactor(const std::vector<double>& residuals,
                           const MeasuredSigmaOptions& options = {});

}  // namespace vgtw
