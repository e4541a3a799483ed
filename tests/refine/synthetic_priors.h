// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/bundle_priors.h"
#include "scene/random.h"
#include "scene/reconstruction.h"

#include <algorithm>
#include <cmath>

namespace vgtw {

// Some world that is not the model's.
inline const Sim3d kReferenceFromWorld = {
    2.5, RotationAboutAxis(Eigen::Vector3d(1.0, -2.0, 0.5).normalized(), 70.0), {10.0, -4.0, 3.0}};

inline std::map<ImageId, Rigid3d> PosesOf(const Reconstruction& model) {
  std::map<ImageId, Rigid3d> poses;
  for (const auto& [image_id, image] : model.images) poses[image_id] = image.cam_from_world;
  return poses;
}

// Errors of this size in the priors, which state it as their sigma.
struct PriorErrors {
  double rotation_deg = 0.0;
  double centre = 0.0;  // per axis, in units of the model
};
inline constexpr PriorErrors kStatedForExact = {0.1, 0.01};

inline PosePriors PosePriorsOf(const Reconstruction& truth,
                               const PriorErrors& errors,
                               uint64_t seed) {
  RandomStream random(HashKey({seed}));
  const bool exact = errors.centre == 0.0;
  PosePriors priors;
  for (const auto& [image_id, image] : truth.images) {
    Rigid3d pose = image.cam_from_world;
    const Eigen::Vector3d turn_deg = errors.rotation_deg * random.NormalVector();
    const Eigen::Vector3d centre = OriginInSource(pose) + errors.centre * random.NormalVector();
    if (!exact) {
      pose.rotation =
          (RotationAboutAxis(turn_deg.normalized(), turn_deg.norm()) * pose.rotation).normalized();
      pose.translation = -(pose.rotation * centre);
    }
    const PriorErrors& stated = exact ? kStatedForExact : errors;
    priors.by_image[image_id] = {TransformCamera(kReferenceFromWorld, pose),
                                 stated.rotation_deg,
                                 kReferenceFromWorld.scale * stated.centre};
  }
  return priors;
}

inline CentrePriors CentrePriorsOf(const Reconstruction& truth, double sigma, uint64_t seed) {
  RandomStream random(HashKey({seed}));
  CentrePriors priors;
  for (const auto& [image_id, image] : truth.images) {
    const Eigen::Vector3d centre =
        OriginInSource(image.cam_from_world) + sigma * random.NormalVector();
    priors.by_image[image_id] = {
        kReferenceFromWorld * centre,
        Eigen::Vector3d::Constant(kReferenceFromWorld.scale * std::max(sigma, 0.01))};
  }
  return priors;
}

inline std::map<CameraId, FocalPrior> FocalPriorsOf(const Reconstruction& truth) {
  std::map<CameraId, FocalPrior> priors;
  for (const auto& [camera_id, camera] : truth.cameras) {
    priors[camera_id] = {camera.FocalLengthX(), camera.FocalLengthY(), 0.01};
  }
  return priors;
}

// Depths of the truth in a unit that is half the scene's.
inline DepthPriors DepthPriorsOf(const Reconstruction& truth, double log_sigma, uint64_t seed) {
  RandomStream random(HashKey({seed}));
  DepthPriors priors;
  for (const auto& [image_id, image] : truth.images) {
    for (uint32_t i = 0; i < image.points2D.size(); ++i) {
      const Point2D& point2D = image.points2D[i];
      const double depth = (image.cam_from_world * truth.points3D.at(point2D.point3D_id).xyz).z();
      const double error = std::exp(log_sigma * random.Normal());
      priors.by_image[image_id].push_back({i, 2.0 * depth * error, std::max(log_sigma, 0.01)});
    }
  }
  return priors;
}

inline BundlePriors ExactPriors(const Reconstruction& truth) {
  BundlePriors priors;
  priors.poses = PosePriorsOf(truth, {}, 0);
  priors.centres = CentrePriorsOf(truth, 0.0, 0);
  priors.focal_lengths = FocalPriorsOf(truth);
  priors.depths = DepthPriorsOf(truth, 0.0, 0);
  return priors;
}

}  // namespace vgtw
