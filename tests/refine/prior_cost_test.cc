// SPDX-License-Identifier: BSD-3-Clause
#include "refine/prior_cost.h"

#include "refine/reprojection_cost.h"
#include "scene/random.h"
#include "scene/sim3d.h"

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include <ceres/gradient_checker.h>
#include <ceres/manifold.h>
#include <ceres/product_manifold.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Rotation = ceres::EigenQuaternionManifold;
using PoseManifold = ceres::ProductManifold<Rotation, ceres::EuclideanManifold<3>>;
using SimilarityManifold = ceres::ProductManifold<Rotation, ceres::EuclideanManifold<4>>;

// A camera and a similarity at random, the same camera in the reference world, and the blocks.
struct RandomView {
  explicit RandomView(uint64_t seed) {
    RandomStream random(HashKey({seed}));
    cam_from_world.rotation = random.Rotation();
    cam_from_world.translation = random.NormalVector();
    reference_from_world.scale = random.Uniform(0.2, 5.0);
    reference_from_world.rotation = random.Rotation();
    reference_from_world.translation = 3.0 * random.NormalVector();
    cam_from_reference = TransformCamera(reference_from_world, cam_from_world);
    const Eigen::Vector4d& q = cam_from_world.rotation.coeffs();
    const Eigen::Vector3d& t = cam_from_world.translation;
    pose = {q[0], q[1], q[2], q[3], t[0], t[1], t[2]};
    const Eigen::Vector4d& sq = reference_from_world.rotation.coeffs();
    const Eigen::Vector3d& st = reference_from_world.translation;
    similarity = {
        sq[0], sq[1], sq[2], sq[3], st[0], st[1], st[2], std::log(reference_from_world.scale)};
  }
  std::vector<const double*> blocks() const { return {pose.data(), similarity.data()}; }

  Rigid3d cam_from_world;
  Sim3d reference_from_world;
  Rigid3d cam_from_reference;
  std::array<double, kNumPoseParams> pose;
  std::array<double, kNumSimilarityParams> similarity;
};

Eigen::VectorXd Evaluate(const ceres::CostFunction& cost,
                         const std::vector<const double*>& blocks) {
  Eigen::VectorXd residuals(cost.num_residuals());
  EXPECT_TRUE(cost.Evaluate(blocks.data(), residuals.data(), nullptr));
  return residuals;
}

void ExpectDerivatives(const ceres::CostFunction& cost,
                       const std::vector<const double*>& blocks,
                       const std::vector<const ceres::Manifold*>& manifolds) {
  ceres::NumericDiffOptions options;
  options.ridders_relative_initial_step_size = 1e-3;  // logarithms bend within a hundredth
  const ceres::GradientChecker checker(&cost, &manifolds, options);
  ceres::GradientChecker::ProbeResults results;
  checker.Probe(blocks.data(), 1.0, &results);
  ASSERT_TRUE(results.return_value);
  for (size_t i = 0; i < blocks.size(); ++i) {
    // Relative to the whole matrix, because some entries are zero by structure (a centre's x by a
    // turn about x), where Ridders' method leaves rounding.
    const double error = (results.local_jacobians[i] - results.local_numeric_jacobians[i]).norm();
    EXPECT_LE(error, 1e-8 * results.local_jacobians[i].norm()) << "block " << i;
  }
}

TEST(PriorCost, PosesAreZeroAtTheTruth) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const RandomView view(seed);
    const auto rotation = MakeRotationPriorCost(view.cam_from_reference.rotation, 10.0);
    EXPECT_LT(Evaluate(*rotation, view.blocks()).norm(), 1e-13);
    const auto centre =
        MakeCentrePriorCost(OriginInSource(view.cam_from_reference), {10.0, 10.0, 10.0});
    EXPECT_LT(Evaluate(*centre, view.blocks()).norm(), 1e-12);
  }
}

TEST(PriorCost, PosesCountInSigmas) {
  const RandomView view(1);
  // A prior that is turned by 0.3 degrees, with a sigma of 0.1 degrees.
  const double sigma = 0.1 * std::numbers::pi / 180.0;
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, 2.0, -1.0).normalized();
  const Eigen::Quaterniond turned = RotationAboutAxis(axis, 0.3) * view.cam_from_reference.rotation;
  const auto rotation = MakeRotationPriorCost(turned, 1.0 / sigma);
  const Eigen::Vector3d residual = Evaluate(*rotation, view.blocks());
  // The rotation from prior to camera, about the camera's axes.
  EXPECT_LT((residual + 3.0 * axis).norm(), 1e-9);
  // A prior that is 0.2 off along y with a sigma of 0.05.
  const Eigen::Vector3d centre = OriginInSource(view.cam_from_reference);
  const auto moved = MakeCentrePriorCost(centre + Eigen::Vector3d(0.0, 0.2, 0.0), {1.0, 20.0, 5.0});
  EXPECT_LT((Evaluate(*moved, view.blocks()) - Eigen::Vector3d(0.0, 4.0, 0.0)).norm(), 1e-11);
}

TEST(PriorCost, DerivativesOfPosesEqualFiniteDifferences) {
  const PoseManifold pose;
  const SimilarityManifold similarity;
  const Eigen::Vector3d axis = Eigen::Vector3d(-2.0, 1.0, 0.5).normalized();
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const RandomView view(seed);
    for (const double turn_deg : {1.0, 60.0}) {
      const Rigid3d turn = {RotationAboutAxis(axis, turn_deg), axis};
      const Rigid3d prior = turn * view.cam_from_reference;
      ExpectDerivatives(
          *MakeRotationPriorCost(prior.rotation, 2.0), view.blocks(), {&pose, &similarity});
      ExpectDerivatives(*MakeCentrePriorCost(OriginInSource(prior), {1.0, 2.0, 3.0}),
                        view.blocks(),
                        {&pose, &similarity});
    }
  }
}

TEST(PriorCost, FocalLengthsCountInLogs) {
  const double opencv[] = {110.0, 90.0, 50.0, 40.0, 0.1, 0.0, 0.0, 0.0};
  const auto both = MakeFocalPriorCost(CameraModel::kOpenCV, {100.0, 100.0}, 20.0);
  const Eigen::VectorXd residual = Evaluate(*both, {opencv});
  ASSERT_EQ(residual.size(), 2);
  EXPECT_NEAR(residual[0], 20.0 * std::log(1.1), 1e-12);
  EXPECT_NEAR(residual[1], 20.0 * std::log(0.9), 1e-12);
  ExpectDerivatives(*both, {opencv}, {nullptr});
  const double radial[] = {100.0, 50.0, 40.0, 0.1};
  const auto one = MakeFocalPriorCost(CameraModel::kSimpleRadial, {90.0, 110.0}, 20.0);
  EXPECT_NEAR(Evaluate(*one, {radial})[0], 0.0, 1e-12);
  ExpectDerivatives(*one, {radial}, {nullptr});
  const double negative[] = {-100.0, 50.0, 40.0, 0.1};
  const double* blocks[] = {negative};
  double value;
  EXPECT_FALSE(one->Evaluate(blocks, &value, nullptr));
}

// A point at depth 6 that was predicted at 2 in a view with the median depth 4.
struct DepthBlocks {
  std::array<double, kNumPoseParams> pose = {0.0, 0.0, 0.0, 1.0, 0.1, 0.2, 1.0};
  std::array<double, 3> point = {0.5, -0.3, 5.0};
  double log_scale = std::log(2.0);
  std::array<double, 2> view = {std::log(1.1), 0.2};

  std::vector<const double*> blocks() const {
    return {pose.data(), point.data(), &log_scale, view.data()};
  }
};

TEST(PriorCost, DepthsCountInLogsOfScaledAndShiftedPredictions) {
  const DepthBlocks depth;
  const auto cost = MakeDepthPriorCost(2.0, 4.0, 10.0);
  // 2 (1.1 * 2 + 0.2 * 4) = 6.
  EXPECT_NEAR(Evaluate(*cost, depth.blocks())[0], 0.0, 1e-12);
  DepthBlocks farther = depth;
  farther.point[2] = 5.44;
  // 2 (1.1 * 2.2 + 0.2 * 4) = 6.44: a tenth more than predicted.
  EXPECT_NEAR(Evaluate(*cost, farther.blocks())[0], 10.0 * std::log(1.1), 1e-12);
}

TEST(PriorCost, DepthsHaveDerivativesEvenBehindTheCamera) {
  const PoseManifold pose;
  DepthBlocks depth;
  const auto cost = MakeDepthPriorCost(2.0, 4.0, 10.0);
  for (const double z : {4.0, 1.0, 0.6, -3.0}) {
    depth.point[2] = z;
    SCOPED_TRACE(z);
    ExpectDerivatives(*cost, depth.blocks(), {&pose, nullptr, nullptr, nullptr});
  }
  depth.view = {0.0, -0.7};
  ExpectDerivatives(*cost, depth.blocks(), {&pose, nullptr, nullptr, nullptr});
}

}  // namespace
}  // namespace vgtw
