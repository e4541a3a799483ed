// SPDX-License-Identifier: BSD-3-Clause
#include "refine/bundle_problem.h"

#include "scene/parallel.h"
#include "scene/reprojection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vgtw {
namespace {

using Observation = BundleParticipants::Observation;
using PoseBlock = std::array<double, kNumPoseParams>;

// Fewer do not determine the 6 degrees of freedom of a pose.
constexpr size_t kMinPoseObservations = 3;

bool HasTwoImages(const std::vector<Observation>& observations) {
  return std::any_of(observations.begin(), observations.end(), [&](const Observation& other) {
    return other.image_idx != observations.front().image_idx;
  });
}

// Labels of the groups of images that are linked by common points (union-find).
std::vector<size_t> FindComponents(const BundleParticipants& participants) {
  std::vector<size_t> parents(participants.image_ids.size());
  std::iota(parents.begin(), parents.end(), size_t{0});
  const auto find_root = [&parents](size_t i) {
    while (parents[i] != i) i = parents[i] = parents[parents[i]];
    return i;
  };
  for (const std::vector<Observation>& observations : participants.observations) {
    const size_t root = find_root(observations.front().image_idx);
    for (const Observation& other : observations) parents[find_root(other.image_idx)] = root;
  }
  std::vector<size_t> labels(parents.size());
  for (size_t i = 0; i < labels.size(); ++i) labels[i] = find_root(i);
  return labels;
}

// The images that have observations.
std::map<ImageId, LinkedImage> LinkImages(const Reconstruction& reconstruction,
                                          const BundleParticipants& participants) {
  const std::vector<size_t> components = FindComponents(participants);
  std::map<ImageId, LinkedImage> images;
  for (size_t i = 0; i < components.size(); ++i) {
    if (participants.num_observations[i] == 0) continue;
    const ImageId image_id = participants.image_ids[i];
    images[image_id] = {reconstruction.images.at(image_id).cam_from_world, components[i]};
  }
  return images;
}

// Images without observations are held, and no part of the gauge; no part of it either, but free,
// are those that priors anchor.
Gauge ChooseGauge(const BundleAdjustmentOptions& options,
                  const Reconstruction& reconstruction,
                  const BundleParticipants& participants,
                  const std::map<ImageId, LinkedImage>& linked_images,
                  const std::set<ImageId>& anchored) {
  Gauge gauge;
  gauge.is_held.assign(participants.image_ids.size(), true);
  gauge.held_coordinates.assign(participants.image_ids.size(), -1);
  std::vector<GaugeImage> images;
  std::vector<size_t> image_idxs;
  for (size_t i = 0; i < participants.image_ids.size(); ++i) {
    const size_t num_observations = participants.num_observations[i];
    if (num_observations == 0) continue;
    const Image& image = reconstruction.images.at(participants.image_ids[i]);
    const bool is_held = !options.refine_poses || options.fixed_images.contains(image.image_id) ||
                         num_observations < kMinPoseObservations;
    if (anchored.contains(image.image_id)) {
      gauge.is_held[i] = is_held;
      continue;
    }
    const LinkedImage& linked = linked_images.at(image.image_id);
    images.push_back(
        {image.name, image.cam_from_world, num_observations, linked.component, is_held});
    image_idxs.push_back(i);
  }
  const Gauge dense = ChooseGauge(images);
  gauge.description = dense.description;
  if (!anchored.empty()) {
    gauge.description += (images.empty() ? "" : "; ") + std::string("the world of the priors");
  }
  for (size_t i = 0; i < image_idxs.size(); ++i) {
    gauge.is_held[image_idxs[i]] = dense.is_held[i];
    gauge.held_coordinates[image_idxs[i]] = dense.held_coordinates[i];
  }
  return gauge;
}

PoseBlock ToBlock(const Rigid3d& pose) {
  const Eigen::Vector4d& xyzw = pose.rotation.coeffs();
  const Eigen::Vector3d& t = pose.translation;
  return {xyzw[0], xyzw[1], xyzw[2], xyzw[3], t[0], t[1], t[2]};
}

Rigid3d FromBlock(const PoseBlock& block) {
  return {Eigen::Quaterniond(block[3], block[0], block[1], block[2]).normalized(),
          Eigen::Vector3d(block[4], block[5], block[6])};
}

// Indices of the camera's parameters that stay as they are.
std::vector<int> FixedParams(const BundleAdjustmentOptions& options, const Camera& camera) {
  const int num_focal = GetCameraModelInfo(camera.model).num_focal_lengths;
  std::vector<int> fixed;
  for (int i = 0; i < static_cast<int>(camera.params.size()); ++i) {
    const bool is_refined = i < num_focal       ? options.refine_focal_length
                            : i < num_focal + 2 ? options.refine_principal_point
                                                : options.refine_extra_params;
    if (!is_refined) fixed.push_back(i);
  }
  return fixed;
}

std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleAdjustmentOptions& options) {
  switch (options.loss) {
    case RobustLoss::kHuber:
      return std::make_unique<ceres::HuberLoss>(options.loss_scale_px);
    case RobustLoss::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(options.loss_scale_px);
    case RobustLoss::kTrivial:
      break;
  }
  return std::make_unique<ceres::TrivialLoss>();
}

ceres::Problem::Options WithoutLossOwnership() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

}  // namespace

BundleParticipants FindBundleParticipants(const Reconstruction& reconstruction) {
  BundleParticipants participants;
  std::map<ImageId, size_t> idx_by_image_id;
  for (const auto& [image_id, image] : reconstruction.images) {
    idx_by_image_id[image_id] = participants.image_ids.size();
    participants.image_ids.push_back(image_id);
  }
  participants.num_observations.assign(participants.image_ids.size(), 0);
  for (const auto& [point3D_id, point] : reconstruction.points3D) {
    std::vector<Observation> observations;
    for (const TrackElement& element : point.track) {
      const Image& image = reconstruction.images.at(element.image_id);
      const Point2D& point2D = image.points2D[element.point2D_idx];
      const auto error_px = ReprojectionError(reconstruction, image, point2D);
      if (!error_px || !std::isfinite(*error_px)) continue;
      observations.push_back({idx_by_image_id.at(element.image_id), point2D.xy});
    }
    if (!HasTwoImages(observations)) continue;
    for (const Observation& observation : observations) {
      ++participants.num_observations[observation.image_idx];
    }
    participants.point3D_ids.push_back(point3D_id);
    participants.observations.push_back(std::move(observations));
  }
  return participants;
}

BundleProblem::BundleProblem(const BundleAdjustmentOptions& options,
                             const Reconstruction& reconstruction,
                             const BundleParticipants& participants)
    : options_(options),
      reconstruction_(reconstruction),
      participants_(participants),
      loss_(MakeLoss(options)),
      problem_(WithoutLossOwnership()) {
  std::map<ImageId, LinkedImage> images = LinkImages(reconstruction, participants);
  prior_ties_ = TieComponents(options.priors, images);
  gauge_ = ChooseGauge(options, reconstruction, participants, images, prior_ties_.anchored);
  ChooseWorkingFrame();
  CopyParameters();
  AddResiduals();
  AddPriors();
  HoldPoses();
  HoldIntrinsics();
}

void BundleProblem::ChooseWorkingFrame() {
  const auto most = std::max_element(participants_.num_observations.begin(),
                                     participants_.num_observations.end());
  const auto idx = static_cast<size_t>(most - participants_.num_observations.begin());
  const Rigid3d& cam_from_world =
      reconstruction_.images.at(participants_.image_ids[idx]).cam_from_world;
  double extent = 0.0;
  for (const ImageId image_id : participants_.image_ids) {
    const Eigen::Vector3d centre =
        OriginInSource(reconstruction_.images.at(image_id).cam_from_world);
    extent = std::max(extent, (cam_from_world * centre).norm());
  }
  const double scale = extent > 0.0 ? 1.0 / extent : 1.0;
  working_from_world_ = {scale, cam_from_world.rotation, scale * cam_from_world.translation};
}

void BundleProblem::CopyParameters() {
  for (const ImageId image_id : participants_.image_ids) {
    poses_.push_back(ToBlock(
        TransformCamera(working_from_world_, reconstruction_.images.at(image_id).cam_from_world)));
  }
  for (const Point3DId point3D_id : participants_.point3D_ids) {
    points_.push_back(working_from_world_ * reconstruction_.points3D.at(point3D_id).xyz);
  }
  for (const auto& [camera_id, camera] : reconstruction_.cameras) {
    params_[camera_id] = camera.params;
  }
}

void BundleProblem::AddResiduals() {
  for (size_t i = 0; i < points_.size(); ++i) {
    for (const Observation& observation : participants_.observations[i]) {
      const ImageId image_id = participants_.image_ids[observation.image_idx];
      const CameraId camera_id = reconstruction_.images.at(image_id).camera_id;
      problem_.AddResidualBlock(
          MakeReprojectionCost(reconstruction_.cameras.at(camera_id).model, observation.pixel)
              .release(),
          loss_.get(),
          poses_[observation.image_idx].data(),
          points_[i].data(),
          params_.at(camera_id).data());
    }
  }
}

void BundleProblem::AddPriors() {
  PriorTargets targets;
  targets.working_from_world = working_from_world_;
  for (size_t i = 0; i < poses_.size(); ++i) {
    if (participants_.num_observations[i] == 0) continue;
    targets.poses[participants_.image_ids[i]] = poses_[i].data();
  }
  for (auto& [camera_id, params] : params_) {
    if (problem_.HasParameterBlock(params.data())) targets.params[camera_id] = params.data();
  }
  for (size_t i = 0; i < points_.size() && !options_.priors.depths.by_image.empty(); ++i) {
    targets.points[participants_.point3D_ids[i]] = points_[i].data();
  }
  priors_.emplace(options_.priors, prior_ties_, reconstruction_, targets, problem_);
}

void BundleProblem::HoldPoses() {
  using Rotation = ceres::EigenQuaternionManifold;
  for (size_t i = 0; i < poses_.size(); ++i) {
    double* pose = poses_[i].data();
    if (!problem_.HasParameterBlock(pose)) continue;
    const int held = gauge_.held_coordinates[i];
    if (gauge_.is_held[i]) {
      problem_.SetParameterBlockConstant(pose);
    } else if (held >= 0) {
      problem_.SetManifold(pose,
                           new ceres::ProductManifold<Rotation, ceres::SubsetManifold>(
                               Rotation(), ceres::SubsetManifold(3, {held})));
    } else {
      problem_.SetManifold(pose,
                           new ceres::ProductManifold<Rotation, ceres::EuclideanManifold<3>>());
    }
  }
}

void BundleProblem::HoldIntrinsics() {
  for (auto& [camera_id, params] : params_) {
    if (!problem_.HasParameterBlock(params.data())) continue;
    const std::vector<int> fixed = FixedParams(options_, reconstruction_.cameras.at(camera_id));
    if (fixed.size() == params.size()) {
      problem_.SetParameterBlockConstant(params.data());
    } else if (!fixed.empty()) {
      problem_.SetManifold(params.data(),
                           new ceres::SubsetManifold(static_cast<int>(params.size()), fixed));
    }
  }
}

LevenbergMarquardtSummary BundleProblem::Solve() {
  LevenbergMarquardtOptions options;
  options.num_threads = ResolveThreads(options_.num_threads);
  options.max_num_iterations = options_.max_num_iterations;
  options.max_seconds = options_.max_seconds;
  // Slow valleys (focal length against depth) lose little cost per step on noisy data.
  options.function_tolerance = options_.function_tolerance;
  options.on_iteration = options_.on_iteration;
  return Minimise(options, problem_, points_);
}

bool BundleProblem::IsPossible() const {
  const auto is_finite = [](double value) { return std::isfinite(value); };
  for (const PoseBlock& pose : poses_) {
    if (!std::all_of(pose.begin(), pose.end(), is_finite)) return false;
  }
  for (const Eigen::Vector3d& point : points_) {
    if (!point.allFinite()) return false;
  }
  for (const auto& [camera_id, params] : params_) {
    Camera camera = reconstruction_.cameras.at(camera_id);
    camera.params = params;
    if (!FindFault(camera).empty()) return false;
  }
  return true;
}

void BundleProblem::WriteTo(Reconstruction& reconstruction) const {
  const Sim3d world_from_working = Inverse(working_from_world_);
  for (size_t i = 0; i < poses_.size(); ++i) {
    if (gauge_.is_held[i]) continue;
    reconstruction.images.at(participants_.image_ids[i]).cam_from_world =
        TransformCamera(world_from_working, FromBlock(poses_[i]));
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    reconstruction.points3D.at(participants_.point3D_ids[i]).xyz = world_from_working * points_[i];
  }
  for (const auto& [camera_id, params] : params_) {
    reconstruction.cameras.at(camera_id).params = params;
  }
}

}  // namespace vgtw
