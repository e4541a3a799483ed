// SPDX-License-Identifier: BSD-3-Clause
#include "refine/uncertainty.h"

#include "refine/bundle_problem.h"
#include "refine/cross_matrix.h"
#include "refine/reduced_information.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>

#include <Eigen/Geometry>

namespace vgtw {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Of exact data, pixels^2: their weights must stay finite.
constexpr double kMinVariance = 1e-24;

// d(w, d) / d(pose block) at a unit quaternion, see PoseUncertainty; d in the frame of the block.
Eigen::Matrix<double, 6, kNumPoseParams> PoseByBlock(const double* block) {
  const Eigen::Quaterniond rotation(block[3], block[0], block[1], block[2]);
  const Eigen::Map<const Eigen::Vector3d> translation(block + 4);
  const Eigen::Matrix3d world_from_cam = rotation.toRotationMatrix().transpose();
  Eigen::Matrix<double, 6, kNumPoseParams> derivative;
  derivative.setZero();
  // dq = (w / 2) q, so that w = 2 vec(dq q*).
  derivative.block<3, 3>(0, 0) =
      2.0 * (rotation.w() * Eigen::Matrix3d::Identity() + CrossMatrix(rotation.vec()));
  derivative.block<3, 1>(0, 3) = -2.0 * rotation.vec();
  // c = -R^T t and R = Exp(w) R_0: dc = -R^T (dt + t x w).
  derivative.block<3, 4>(3, 0) =
      -world_from_cam * CrossMatrix(translation) * derivative.block<3, 4>(0, 0);
  derivative.block<3, 3>(3, 4) = -world_from_cam;
  return derivative;
}

// d(block) / d(tangent).
RowMajor BlockByTangent(const ceres::Problem& problem, const double* block, int ambient_size) {
  const ceres::Manifold* manifold = problem.GetManifold(block);
  if (!manifold) return RowMajor::Identity(ambient_size, ambient_size);
  RowMajor derivative(ambient_size, manifold->TangentSize());
  manifold->PlusJacobian(block, derivative.data());
  return derivative;
}

// Sums over the observations, for the variance of a robust estimate: psi = w r, whose derivative
// by r has the eigenvalues w across r and w + 2 rho'' |r|^2 along it.
struct ObservationSums {
  double num_blocks = 0.0;     // of two residuals each
  double num_residuals = 0.0;  // with those of priors
  double squared_psi = 0.0;
  double weight = 0.0;
  double slope = 0.0;          // mean of the two eigenvalues
  double squared_slope = 0.0;  // mean of their squares

  // See EstimateUncertainty.
  double Variance(double num_unknowns) const {
    const double unknown_share = num_unknowns / num_residuals;
    const double mean_slope = slope / num_blocks;
    const double slope_variance = squared_slope / num_blocks - mean_slope * mean_slope;
    const double correction = 1.0 + unknown_share * slope_variance / (mean_slope * mean_slope);
    const double psi_variance = squared_psi / (2.0 * num_blocks * (1.0 - unknown_share));
    return std::pow(correction / mean_slope, 2) * psi_variance;
  }
  double MeanWeight() const { return weight / num_blocks; }
};

ObservationSums SumObservations(const BundleProblem& problem) {
  ObservationSums sums;
  std::vector<ceres::ResidualBlockId> ids;
  problem.problem().GetResidualBlocks(&ids);
  for (const ceres::ResidualBlockId id : ids) {
    sums.num_residuals += problem.problem().GetCostFunctionForResidualBlock(id)->num_residuals();
    if (problem.problem().GetLossFunctionForResidualBlock(id) != &problem.loss()) continue;
    double half_squared_norm = 0.0;
    problem.problem().EvaluateResidualBlock(id, false, &half_squared_norm, nullptr, nullptr);
    const double squared_norm = 2.0 * half_squared_norm;
    double rho[3];
    problem.loss().Evaluate(squared_norm, rho);
    sums.num_blocks += 1.0;
    sums.weight += rho[1];
    sums.squared_psi += rho[1] * rho[1] * squared_norm;
    const double along = rho[1] + 2.0 * rho[2] * squared_norm;
    sums.slope += 0.5 * (rho[1] + along);
    sums.squared_slope += 0.5 * (rho[1] * rho[1] + along * along);
  }
  return sums;
}

// Covariances of blocks as they are stored; zero where they are held.
class AmbientCovariances {
 public:
  AmbientCovariances(const ceres::Problem& problem,
                     const std::vector<ReducedBlock>& blocks,
                     const InverseInformation& inverse)
      : problem_(problem), inverse_(inverse) {
    for (const ReducedBlock& block : blocks) by_values_[block.values] = &block;
  }

  RowMajor Of(const double* block, int size) const {
    const auto reduced = by_values_.find(block);
    if (reduced == by_values_.end()) return RowMajor::Zero(size, size);
    const RowMajor derivative = BlockByTangent(problem_, block, size);
    RowMajor ambient = derivative * inverse_.Covariance(*reduced->second) * derivative.transpose();
    // A held parameter has none even where the others are unknown.
    for (int i = 0; i < size; ++i) {
      if (!derivative.row(i).isZero()) continue;
      ambient.row(i).setZero();
      ambient.col(i).setZero();
    }
    return ambient;
  }

 private:
  const ceres::Problem& problem_;
  const InverseInformation& inverse_;
  std::unordered_map<const double*, const ReducedBlock*> by_values_;
};

PoseUncertainty PoseOf(const AmbientCovariances& covariances,
                       const double* block,
                       const Sim3d& world_from_working) {
  Eigen::Matrix<double, 6, kNumPoseParams> derivative = PoseByBlock(block);
  derivative.bottomRows<3>() = world_from_working.scale *
                               world_from_working.rotation.toRotationMatrix() *
                               derivative.bottomRows<3>().eval();
  PoseUncertainty pose;
  pose.covariance = derivative * covariances.Of(block, kNumPoseParams) * derivative.transpose();
  const Eigen::Matrix<double, 6, 1> variances = pose.covariance.diagonal();
  pose.rotation_deg = std::sqrt(variances.head<3>().mean()) * 180.0 / std::numbers::pi;
  pose.centre = std::sqrt(variances.tail<3>().mean());
  return pose;
}

void FillIn(const BundleProblem& problem,
            const BundleParticipants& participants,
            const AmbientCovariances& covariances,
            Uncertainty& uncertainty) {
  const Sim3d world_from_working = Inverse(problem.working_from_world());
  for (size_t i = 0; i < participants.image_ids.size(); ++i) {
    if (participants.num_observations[i] == 0) continue;
    uncertainty.poses[participants.image_ids[i]] =
        PoseOf(covariances, problem.poses()[i].data(), world_from_working);
  }
  for (const auto& [camera_id, params] : problem.params()) {
    if (!problem.problem().HasParameterBlock(params.data())) continue;
    const RowMajor covariance = covariances.Of(params.data(), static_cast<int>(params.size()));
    std::vector<double>& sigmas = uncertainty.camera_sigmas[camera_id];
    for (const double param_variance : covariance.diagonal()) {
      sigmas.push_back(std::sqrt(param_variance));
    }
  }
}

ResidualWeight MakeWeight(const BundleProblem& problem, double factor, double prior_variance) {
  return [&problem, factor, prior_variance](ceres::ResidualBlockId id, double squared_norm) {
    const ceres::LossFunction* loss = problem.problem().GetLossFunctionForResidualBlock(id);
    double rho[3] = {squared_norm, 1.0, 0.0};
    if (loss) loss->Evaluate(squared_norm, rho);
    return rho[1] / (loss == &problem.loss() ? factor : prior_variance);
  };
}

PriorRedundancies FindRedundancies(const BundleProblem& problem,
                                   const std::vector<ReducedBlock>& blocks,
                                   const ResidualWeight& weight,
                                   const InverseInformation& inverse) {
  const auto redundancy = [&](const PriorBlocks::ResidualBlockIds& ids) {
    if (ids.empty()) return 1.0;
    double num_residuals = 0.0;
    for (const ceres::ResidualBlockId id : ids) {
      num_residuals += problem.problem().GetCostFunctionForResidualBlock(id)->num_residuals();
    }
    const double leverage = inverse.Leverage(problem.problem(), ids, blocks, weight);
    return std::max(0.0, 1.0 - leverage / num_residuals);
  };
  const PriorBlocks& priors = problem.priors();
  return {redundancy(priors.rotations()),
          redundancy(priors.pose_centres()),
          redundancy(priors.centres()),
          redundancy(priors.focal_lengths())};
}

}  // namespace

void UncertaintyOptions::Check() const {
  VGTW_CHECK(max_num_parameters > 0,
             "UncertaintyOptions::max_num_parameters = " + std::to_string(max_num_parameters) +
                 ", must be > 0");
}

Uncertainty EstimateUncertainty(const BundleAdjustmentOptions& bundle_options,
                                const Reconstruction& reconstruction,
                                const UncertaintyOptions& options) {
  bundle_options.Check();
  options.Check();
  const std::string fault = FindFault(reconstruction);
  VGTW_CHECK(fault.empty(), fault);
  Uncertainty uncertainty;
  const BundleParticipants participants = FindBundleParticipants(reconstruction);
  if (participants.point3D_ids.empty()) {
    uncertainty.message = "no point is observed by two images";
    return uncertainty;
  }
  const BundleProblem problem(bundle_options, reconstruction, participants);
  const ceres::Problem& ceres_problem = problem.problem();
  uncertainty.gauge = problem.gauge().description;
  const std::vector<ReducedBlock> blocks = FindReducedBlocks(ceres_problem, problem.points());
  const int num_parameters = blocks.empty() ? 0 : blocks.back().offset + blocks.back().size;
  if (num_parameters > options.max_num_parameters) {
    uncertainty.message = std::to_string(num_parameters) + " parameters of poses and intrinsics, " +
                          std::to_string(options.max_num_parameters) + " are allowed";
    return uncertainty;
  }
  const ObservationSums sums = SumObservations(problem);
  const double num_unknowns = num_parameters + 3.0 * static_cast<double>(problem.points().size());
  if (!(sums.num_residuals > num_unknowns)) {
    uncertainty.message = "there are no more residuals than unknowns";
    return uncertainty;
  }
  if (!(sums.slope > 0.0)) {
    uncertainty.message = "most residuals are beyond the scale of the robust loss";
    return uncertainty;
  }
  const double variance = std::max(kMinVariance, sums.Variance(num_unknowns));
  uncertainty.sigma_px = std::sqrt(variance);
  const double sigma_px = bundle_options.priors.sigma_px;
  const ResidualWeight weight =
      MakeWeight(problem, variance * sums.MeanWeight(), sigma_px * sigma_px);
  const InverseInformation inverse(
      ReduceInformation(ceres_problem, problem.points(), blocks, weight));
  FillIn(problem, participants, AmbientCovariances(ceres_problem, blocks, inverse), uncertainty);
  uncertainty.prior_redundancies = FindRedundancies(problem, blocks, weight, inverse);
  uncertainty.success = true;
  return uncertainty;
}

}  // namespace vgtw
