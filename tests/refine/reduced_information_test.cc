// SPDX-License-Identifier: BSD-3-Clause
#include "refine/reduced_information.h"

#include "refine/bundle_problem.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <vector>

#include <ceres/covariance.h>
#include <ceres/normal_prior.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A small problem with everything in it: shared intrinsics, held coordinates, priors.
struct SmallProblem {
  explicit SmallProblem(bool with_priors) {
    SyntheticModelOptions model_options;
    model_options.num_images = 5;
    model_options.num_points = 30;
    model_options.camera_model = CameraModel::kSimpleRadial;
    model_options.shared_camera = true;
    model = MakeSyntheticModel(model_options);
    ProjectAgain(model, 0.5, 1);
    options.refine_extra_params = true;
    for (const auto& [image_id, image] : model.images) {
      if (!with_priors) break;
      options.priors.poses.by_image[image_id] = {image.cam_from_world, 0.2, 0.05};
      options.priors.depths.by_image[image_id] = {{3, 4.0, 0.1}, {4, 4.1, 0.1}, {5, 3.8, 0.1}};
    }
    participants = FindBundleParticipants(model);
    problem.emplace(options, model, participants);
  }

  Reconstruction model;
  BundleAdjustmentOptions options;
  BundleParticipants participants;
  std::optional<BundleProblem> problem;
};

double UnitWeight(ceres::ResidualBlockId, double) { return 1.0; }

class ReducedInformation : public testing::TestWithParam<bool> {};

TEST_P(ReducedInformation, GivesTheCovariancesOfCeres) {
  SmallProblem small(GetParam());
  const ceres::Problem& problem = small.problem->problem();
  const std::vector<ReducedBlock> blocks = FindReducedBlocks(problem, small.problem->points());
  const InverseInformation inverse(
      ReduceInformation(problem, small.problem->points(), blocks, UnitWeight));

  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  options.apply_loss_function = false;
  ceres::Covariance expected(options);
  std::vector<std::pair<const double*, const double*>> pairs;
  for (const ReducedBlock& block : blocks) pairs.emplace_back(block.values, block.values);
  ASSERT_TRUE(expected.Compute(pairs, const_cast<ceres::Problem*>(&problem)));
  // Four free poses, one of them with a held coordinate, f and k; with priors a similarity of 7, a
  // scale of depth and two parameters per view.
  ASSERT_EQ(blocks.size(), GetParam() ? 5u + 1u + 1u + 5u : 5u);
  ASSERT_EQ(blocks.back().offset + blocks.back().size, 23 + 2 + (GetParam() ? 7 + 1 + 10 : 0));
  for (size_t i = 0; i < blocks.size(); ++i) {
    const int size = blocks[i].size;
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> block(size, size);
    ASSERT_TRUE(expected.GetCovarianceBlockInTangentSpace(
        blocks[i].values, blocks[i].values, block.data()));
    // The inverse of a matrix of condition 1e8 from products is right to about 1e-8.
    EXPECT_LE((inverse.Covariance(blocks[i]) - block).norm(), 1e-6 * block.norm()) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Problems, ReducedInformation, testing::Bool());

TEST(InverseInformation, LeverageIsTheShareThatAnAdjustmentTakes) {
  double x[3] = {0.0, 0.0, 0.0};
  ceres::Problem problem;
  std::vector<ceres::ResidualBlockId> ids;
  for (double& value : x) {
    ids.push_back(problem.AddResidualBlock(
        new ceres::NormalPrior(Eigen::MatrixXd::Constant(1, 1, 2.0), Eigen::VectorXd::Ones(1)),
        nullptr,
        &value));
  }
  ids.push_back(problem.AddResidualBlock(
      new ceres::NormalPrior(Eigen::MatrixXd::Constant(1, 1, 3.0), Eigen::VectorXd::Ones(1)),
      nullptr,
      &x[0]));
  const std::vector<ReducedBlock> blocks = FindReducedBlocks(problem, {});
  const ResidualWeight weight = UnitWeight;
  const InverseInformation inverse(ReduceInformation(problem, {}, blocks, weight));
  // x[0] has information 4 + 9: the first takes 4/13 of its residual away, the last 9/13.
  EXPECT_NEAR(inverse.Leverage(problem, {ids[0]}, blocks, weight), 4.0 / 13.0, 1e-9);
  EXPECT_NEAR(inverse.Leverage(problem, {ids[1]}, blocks, weight), 1.0, 1e-9);
  EXPECT_NEAR(inverse.Leverage(problem, {ids[3]}, blocks, weight), 9.0 / 13.0, 1e-9);
}

TEST(InverseInformation, IsNaNWhereNothingIsKnown) {
  // Two blocks of two; the second one's second direction is that of the first one's.
  const std::vector<ReducedBlock> blocks = {{nullptr, 0, 2}, {nullptr, 2, 1}, {nullptr, 3, 1}};
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(4, 4);
  information.diagonal() << 4.0, 1e6, 1e6, 25.0;
  information(2, 1) = -1e6;
  const InverseInformation inverse(information);
  EXPECT_TRUE(inverse.Covariance(blocks[0]).array().isNaN().all());
  EXPECT_TRUE(inverse.Covariance(blocks[1]).array().isNaN().all());
  EXPECT_NEAR(inverse.Covariance(blocks[2])(0, 0), 1.0 / 25.0, 1e-12);
}

}  // namespace
}  // namespace vgtw
