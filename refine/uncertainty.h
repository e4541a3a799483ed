// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/bundle_adjustment.h"
#include "scene/reconstruction.h"

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct PoseUncertainty {
  // Of (w, d):  R = Exp(w) R_estimated, a rotation vector about the camera's axes in radians, and
  // centre = centre_estimated + d, in scene units.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  // Root mean square of the three axes' standard deviations. 0 where the gauge holds the pose.
  double rotation_deg = 0.0;
  double centre = 0.0;  // scene units
};

struct UncertaintyOptions {
  // Poses and intrinsics are refused above this number: the time grows with its cube (4000, which
  // is 500 images with four intrinsics each: half a minute), the memory with its square.
  int max_num_parameters = 4000;

  void Check() const;
};

// What share of the variance of a group of priors its residuals keep: 1 where the pixels decide, 0
// where the priors have their way. For MeasuredSigmaFactor; 1 for a group without members.
struct PriorRedundancies {
  double rotations = 1.0;
  double pose_centres = 1.0;
  double centres = 1.0;
  double focal_lengths = 1.0;
};

// Sigmas are NaN where the observations do not determine the quantity.
struct Uncertainty {
  bool success = false;
  std::string message;    // why there is none
  std::string gauge;      // what is held, see refine/gauge.h: sigmas are relative to it
  double sigma_px = 0.0;  // of a coordinate of an observation, measured by the residuals
  std::map<ImageId, PoseUncertainty> poses;               // of images that took part
  std::map<CameraId, std::vector<double>> camera_sigmas;  // by parameter; 0 where held
  PriorRedundancies prior_redundancies;
};

// Standard deviations of the poses and intrinsics that AdjustBundle(bundle_options, reconstruction)
// refined, at the present state, which should be its result:
//   covariance = sigma_px^2 mean(w) (sum_i w_i J_i^T J_i)^-1,
//   sigma_px^2 = K^2 (sum |psi_i|^2 / (n - p)) / mean(psi')^2,  K = 1 + p/n var(psi') /
//   mean(psi')^2
// with psi = w r for the weights w of the robust loss, n residuals and p unknowns; for the square
// that is the variance of the residuals. Priors count by their stated sigmas. The points are
// eliminated, that is, as unknown as the poses.
// Source: P. Huber, Robust Statistics, 1981, 7.6, there with sum J^T J in place of its weighted
// mean, which knows where the outliers are.
// Fails, with a message, without redundancy (n <= p) or above the number of parameters.
// Throws std::invalid_argument as AdjustBundle does.
Uncertainty EstimateUncertainty(const BundleAdjustmentOptions& bundle_options,
                                const Reconstruction& reconstruction,
                                const UncertaintyOptions& options = {});

}  // namespace vgtw
