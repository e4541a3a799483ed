// SPDX-License-Identifier: BSD-3-Clause
#include "refine/prior_blocks.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <ceres/normal_prior.h>

namespace vgtw {
namespace {

using Poses = std::map<ImageId, Rigid3d>;

double Rms(const std::vector<double>& values) {
  if (values.empty()) return 0.0;
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

// Images that have a prior, by component.
template <typename Prior>
std::map<size_t, Poses> PosesByComponent(const std::map<ImageId, Prior>& priors,
                                         const std::map<ImageId, LinkedImage>& images) {
  std::map<size_t, Poses> poses;
  for (const auto& [image_id, image] : images) {
    if (priors.contains(image_id)) poses[image.component][image_id] = image.cam_from_world;
  }
  return poses;
}

template <typename Priors>
std::vector<ImageId> MembersOf(const Priors& priors, const std::map<ImageId, LinkedImage>& images) {
  std::vector<ImageId> members;
  for (const auto& [component, poses] : PosesByComponent(priors.by_image, images)) {
    if (!EstimateReferenceFromWorld(priors, poses)) continue;
    for (const auto& [image_id, cam_from_world] : poses) members.push_back(image_id);
  }
  return members;
}

void MergeComponents(const std::vector<ImageId>& members, std::map<ImageId, LinkedImage>& images) {
  std::set<size_t> merged;
  for (const ImageId image_id : members) merged.insert(images.at(image_id).component);
  for (auto& [image_id, image] : images) {
    if (merged.contains(image.component)) image.component = *merged.begin();
  }
}

Poses PosesOf(const std::vector<ImageId>& image_ids, const Reconstruction& reconstruction) {
  Poses poses;
  for (const ImageId image_id : image_ids) {
    poses[image_id] = reconstruction.images.at(image_id).cam_from_world;
  }
  return poses;
}

std::array<double, kNumSimilarityParams> ToBlock(const Sim3d& b_from_a) {
  const Eigen::Vector4d& xyzw = b_from_a.rotation.coeffs();
  const Eigen::Vector3d& t = b_from_a.translation;
  return {xyzw[0], xyzw[1], xyzw[2], xyzw[3], t[0], t[1], t[2], std::log(b_from_a.scale)};
}

Sim3d FromBlock(const std::array<double, kNumSimilarityParams>& block) {
  return {std::exp(block[7]),
          Eigen::Quaterniond(block[3], block[0], block[1], block[2]).normalized(),
          Eigen::Vector3d(block[4], block[5], block[6])};
}

}  // namespace

PriorTies TieComponents(const BundlePriors& priors, std::map<ImageId, LinkedImage>& images) {
  PriorTies ties;
  ties.poses = MembersOf(priors.poses, images);
  ties.centres = MembersOf(priors.centres, images);
  MergeComponents(ties.poses, images);
  MergeComponents(ties.centres, images);
  std::set<size_t> anchored;
  const auto anchor = [&](PriorWorld world, const std::vector<ImageId>& members) {
    if (world != PriorWorld::kSame) return;
    for (const ImageId image_id : members) anchored.insert(images.at(image_id).component);
  };
  anchor(priors.poses.world, ties.poses);
  anchor(priors.centres.world, ties.centres);
  for (const auto& [image_id, image] : images) {
    if (anchored.contains(image.component)) ties.anchored.insert(image_id);
  }
  return ties;
}

PriorBlocks::PriorBlocks(const BundlePriors& priors,
                         const PriorTies& ties,
                         const Reconstruction& reconstruction,
                         const PriorTargets& targets,
                         ceres::Problem& problem)
    : priors_(priors),
      targets_(targets),
      problem_(problem),
      loss_(priors.loss_scale * priors.sigma_px) {
  AddPoses(ties.poses, reconstruction);
  AddCentres(ties.centres, reconstruction);
  AddFocalLengths(reconstruction);
  AddDepths(reconstruction);
  for (Group* group : {&rotations_, &pose_centres_, &centres_, &focal_lengths_, &depths_}) {
    group->initial_rms = Rms(ResidualsOf(*group));
  }
}

void PriorBlocks::Add(Group& group,
                      std::unique_ptr<ceres::CostFunction> cost,
                      const std::vector<double*>& blocks) {
  group.residual_blocks.push_back(problem_.AddResidualBlock(cost.release(), &loss_, blocks));
}

PriorBlocks::SimilarityBlock PriorBlocks::StartOf(
    PriorWorld world, const std::optional<Sim3d>& reference_from_world) const {
  const Sim3d world_from_working = Inverse(targets_.working_from_world);
  if (world == PriorWorld::kSame || !reference_from_world) return ToBlock(world_from_working);
  return ToBlock(*reference_from_world * world_from_working);
}

void PriorBlocks::HoldSimilarity(PriorWorld world, SimilarityBlock& block) {
  if (world == PriorWorld::kSame) {
    problem_.SetParameterBlockConstant(block.data());
  } else {
    using Manifold =
        ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<4>>;
    problem_.SetManifold(block.data(), new Manifold());
  }
}

void PriorBlocks::AddPoses(const std::vector<ImageId>& members,
                           const Reconstruction& reconstruction) {
  if (priors_.poses.by_image.empty()) return;
  if (members.empty()) {
    rotations_.message = "fewer than two images have a prior, or their centres are one place";
    pose_centres_.message = rotations_.message;
    return;
  }
  const PriorWorld world = priors_.poses.world;
  poses_similarity_ =
      StartOf(world, EstimateReferenceFromWorld(priors_.poses, PosesOf(members, reconstruction)));
  for (const ImageId image_id : members) {
    const PosePrior& prior = priors_.poses.by_image.at(image_id);
    const double rotation_sigma = prior.rotation_sigma_deg * std::numbers::pi / 180.0;
    const std::vector<double*> blocks = {targets_.poses.at(image_id), poses_similarity_.data()};
    Add(rotations_,
        MakeRotationPriorCost(prior.cam_from_reference.rotation, priors_.sigma_px / rotation_sigma),
        blocks);
    Add(pose_centres_,
        MakeCentrePriorCost(OriginInSource(prior.cam_from_reference),
                            Eigen::Vector3d::Constant(priors_.sigma_px / prior.centre_sigma)),
        blocks);
  }
  HoldSimilarity(world, poses_similarity_);
}

void PriorBlocks::AddCentres(const std::vector<ImageId>& members,
                             const Reconstruction& reconstruction) {
  if (priors_.centres.by_image.empty()) return;
  if (members.empty()) {
    centres_.message = "fewer than three images have a known centre, or all are on a line";
    return;
  }
  const PriorWorld world = priors_.centres.world;
  centres_similarity_ =
      StartOf(world, EstimateReferenceFromWorld(priors_.centres, PosesOf(members, reconstruction)));
  for (const ImageId image_id : members) {
    const CentrePrior& prior = priors_.centres.by_image.at(image_id);
    Add(centres_,
        MakeCentrePriorCost(prior.centre_in_reference,
                            priors_.sigma_px * prior.sigma.cwiseInverse()),
        {targets_.poses.at(image_id), centres_similarity_.data()});
  }
  HoldSimilarity(world, centres_similarity_);
}

void PriorBlocks::AddFocalLengths(const Reconstruction& reconstruction) {
  for (const auto& [camera_id, prior] : priors_.focal_lengths) {
    const auto params = targets_.params.find(camera_id);
    if (params == targets_.params.end()) continue;
    Add(focal_lengths_,
        MakeFocalPriorCost(reconstruction.cameras.at(camera_id).model,
                           {prior.focal_length_x, prior.focal_length_y},
                           priors_.sigma_px / prior.log_sigma),
        {params->second});
  }
}

std::vector<PriorBlocks::UsedDepth> PriorBlocks::UsableDepths(
    const Image& image, const std::vector<DepthPrior>& priors) {
  std::vector<UsedDepth> used;
  const double* block = targets_.poses.at(image.image_id);
  const Eigen::Map<const Eigen::Quaterniond> rotation(block);
  const Eigen::Map<const Eigen::Vector3d> translation(block + 4);
  for (const DepthPrior& prior : priors) {
    VGTW_CHECK(prior.point2D_idx < image.points2D.size(),
               "DepthPrior::point2D_idx = " + std::to_string(prior.point2D_idx) + ", " +
                   image.name + " has " + std::to_string(image.points2D.size()) + " points2D");
    const auto point = targets_.points.find(image.points2D[prior.point2D_idx].point3D_id);
    if (point == targets_.points.end()) continue;
    const Eigen::Vector3d point_in_cam =
        rotation * Eigen::Map<const Eigen::Vector3d>(point->second) + translation;
    if (point_in_cam.z() > 0.0) used.push_back({prior, point->second, point_in_cam.z()});
  }
  return used;
}

void PriorBlocks::AddDepths(const Reconstruction& reconstruction) {
  std::map<ImageId, std::vector<UsedDepth>> used_by_image;
  std::vector<double> log_scales;
  for (const auto& [image_id, priors] : priors_.depths.by_image) {
    if (!targets_.poses.contains(image_id)) continue;
    std::vector<UsedDepth> used = UsableDepths(reconstruction.images.at(image_id), priors);
    if (used.empty()) continue;
    for (const UsedDepth& depth : used) {
      log_scales.push_back(std::log(depth.depth / depth.prior.depth));
    }
    used_by_image[image_id] = std::move(used);
  }
  if (log_scales.empty()) {
    if (!priors_.depths.by_image.empty()) depths_.message = "no observation has a predicted depth";
    return;
  }
  log_depth_scale_ = Median(std::move(log_scales));
  for (const auto& [image_id, used] : used_by_image) AddDepthsOfView(image_id, used);
}

void PriorBlocks::AddDepthsOfView(ImageId image_id, const std::vector<UsedDepth>& used) {
  std::vector<double> predicted;
  for (const UsedDepth& depth : used) predicted.push_back(depth.prior.depth);
  const double median_depth = Median(std::move(predicted));
  double* view = depth_views_.emplace(image_id, ViewBlock{}).first->second.data();
  for (const UsedDepth& depth : used) {
    Add(depths_,
        MakeDepthPriorCost(
            depth.prior.depth, median_depth, priors_.sigma_px / depth.prior.log_sigma),
        {targets_.poses.at(image_id), depth.point, &log_depth_scale_, view});
  }
  HoldView(view);
}

void PriorBlocks::HoldView(double* view) {
  const DepthPriors& depths = priors_.depths;
  if (!depths.free_view_scales && !depths.free_view_shifts) {
    problem_.SetParameterBlockConstant(view);
    return;
  }
  if (!depths.free_view_scales || !depths.free_view_shifts) {
    problem_.SetManifold(view, new ceres::SubsetManifold(2, {depths.free_view_scales ? 1 : 0}));
  }
  const Eigen::Vector2d weights(priors_.sigma_px / depths.view_scale_log_sigma,
                                priors_.sigma_px / depths.view_shift_sigma);
  problem_.AddResidualBlock(
      new ceres::NormalPrior(weights.asDiagonal().toDenseMatrix(), Eigen::Vector2d::Zero()),
      nullptr,
      view);
}

std::vector<double> PriorBlocks::ResidualsOf(const Group& group) const {
  std::vector<double> residuals;
  for (const ceres::ResidualBlockId id : group.residual_blocks) {
    const int size = problem_.GetCostFunctionForResidualBlock(id)->num_residuals();
    Eigen::VectorXd values(size);
    if (!problem_.EvaluateResidualBlock(id, false, nullptr, values.data(), nullptr)) continue;
    for (const double value : values) residuals.push_back(value / priors_.sigma_px);
  }
  return residuals;
}

PriorGroupSummary PriorBlocks::Summarize(const Group& group) const {
  PriorGroupSummary summary;
  summary.num_priors = group.residual_blocks.size();
  summary.residuals = ResidualsOf(group);
  summary.initial_rms = group.initial_rms;
  summary.final_rms = Rms(summary.residuals);
  summary.message = group.message;
  return summary;
}

BundlePriorsSummary PriorBlocks::Summarize() const {
  BundlePriorsSummary summary;
  summary.rotations = Summarize(rotations_);
  summary.pose_centres = Summarize(pose_centres_);
  summary.centres = Summarize(centres_);
  summary.focal_lengths = Summarize(focal_lengths_);
  summary.depths = Summarize(depths_);
  const auto reference_from_world = [&](PriorWorld world, const SimilarityBlock& block) {
    return world == PriorWorld::kSame ? Sim3d() : FromBlock(block) * targets_.working_from_world;
  };
  if (summary.rotations.num_priors > 0) {
    summary.poses_reference_from_world =
        reference_from_world(priors_.poses.world, poses_similarity_);
  }
  if (summary.centres.num_priors > 0) {
    summary.centres_reference_from_world =
        reference_from_world(priors_.centres.world, centres_similarity_);
  }
  if (summary.depths.num_priors > 0) {
    summary.depth_scale = std::exp(log_depth_scale_) / targets_.working_from_world.scale;
  }
  return summary;
}

}  // namespace vgtw
