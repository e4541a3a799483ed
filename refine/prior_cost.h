// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"

#include <memory>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <ceres/cost_function.h>

namespace vgtw {

// A similarity as one block: quaternion xyzw, translation, log scale.
inline constexpr int kNumSimilarityParams = 8;

// The residuals of refine/bundle_priors.h times `weight`, which is sigma_px / sigma. The pose block
// is that of refine/reprojection_cost.h.

// Residual [3] (radians):  log(R R_s^T R_prior^T). Blocks: pose, similarity reference_from_world.
std::unique_ptr<ceres::CostFunction> MakeRotationPriorCost(
    const Eigen::Quaterniond& cam_from_reference, double weight);

// Residual [3]:  c_prior - reference_from_world * c. Blocks: pose, similarity.
std::unique_ptr<ceres::CostFunction> MakeCentrePriorCost(const Eigen::Vector3d& centre_in_reference,
                                                         const Eigen::Vector3d& weights);

// Residual [1 or 2]:  log(f / f_prior). Block: the camera's parameters.
std::unique_ptr<ceres::CostFunction> MakeFocalPriorCost(CameraModel model,
                                                        const Eigen::Vector2d& focal_lengths,
                                                        double weight);

// Residual [1]:  log((z / s - t m) / (e^v D)).
// Blocks: pose, point, log s [1], view [2] = (v, t). Where z / s - t m is below a hundredth of m
// the logarithm goes on as a straight line, so that points behind the camera are drawn to its
// front.
std::unique_ptr<ceres::CostFunction> MakeDepthPriorCost(double depth,
                                                        double median_depth,
                                                        double weight);

}  // namespace vgtw
