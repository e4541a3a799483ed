// SPDX-License-Identifier: BSD-3-Clause
#include "refine/uncertainty.h"

#include "refine/align.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

// (w, d) of PoseUncertainty.
Vector6 PoseError(const Rigid3d& estimate, const Rigid3d& truth) {
  const Eigen::AngleAxisd turn(truth.rotation * estimate.rotation.conjugate());
  Vector6 error;
  error << turn.angle() * turn.axis(), OriginInSource(truth) - OriginInSource(estimate);
  return error;
}

struct MonteCarlo {
  RobustLoss loss = RobustLoss::kTrivial;
  bool with_centre_priors = false;
  double outlier_share = 0.0;  // of observations, 10 to 50 px off
};

class Uncertainties : public testing::TestWithParam<MonteCarlo> {};

// Of 100 noisy copies of one scene: the errors are as large as stated, with their correlations.
TEST_P(Uncertainties, AreTheScatterOfSolutions) {
  constexpr int kNumSolutions = 100;
  constexpr double kSigmaPx = 0.7;
  SyntheticModelOptions model_options;
  model_options.num_images = 5;
  model_options.num_points = 40;
  model_options.camera_model = CameraModel::kSimplePinhole;
  model_options.shared_camera = true;
  const Reconstruction truth = MakeSyntheticModel(model_options);
  BundleAdjustmentOptions options;
  options.loss = GetParam().loss;
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0.0, 0.01);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);

  std::map<ImageId, double> squared_distances;  // Mahalanobis
  std::map<ImageId, double> squared_degs, stated_squared_degs;
  double squared_focal = 0.0;
  double sum_sigma_px = 0.0;
  for (int i = 0; i < kNumSolutions; ++i) {
    Reconstruction solution = truth;
    ProjectAgain(solution, kSigmaPx, static_cast<unsigned>(i));
    if (GetParam().with_centre_priors) {
      options.priors.sigma_px = kSigmaPx;
      options.priors.loss_scale = 100.0;
      options.priors.centres.world = PriorWorld::kSame;
      for (const auto& [image_id, image] : truth.images) {
        const double x = normal(random);
        const double y = normal(random);
        const Eigen::Vector3d error(x, y, normal(random));
        options.priors.centres.by_image[image_id] = {OriginInSource(image.cam_from_world) + error,
                                                     Eigen::Vector3d::Constant(0.01)};
      }
    }
    for (auto& [image_id, image] : solution.images) {
      for (Point2D& point2D : image.points2D) {
        if (uniform(random) < GetParam().outlier_share) {
          point2D.xy += Eigen::Vector2d(10.0 + 40.0 * uniform(random), 10.0);
        }
      }
    }
    ASSERT_TRUE(AdjustBundle(options, solution).success);
    const Uncertainty uncertainty = EstimateUncertainty(options, solution);
    ASSERT_TRUE(uncertainty.success) << uncertainty.message;
    sum_sigma_px += uncertainty.sigma_px;
    for (const auto& [image_id, pose] : uncertainty.poses) {
      const Vector6 error = PoseError(solution.images.at(image_id).cam_from_world,
                                      truth.images.at(image_id).cam_from_world);
      squared_degs[image_id] += std::pow(error.head<3>().norm() * 180.0 / std::numbers::pi, 2);
      stated_squared_degs[image_id] += 3.0 * pose.rotation_deg * pose.rotation_deg;
      if (pose.covariance.ldlt().rcond() < 1e-14) continue;  // of an image that the gauge holds
      squared_distances[image_id] += error.dot(pose.covariance.ldlt().solve(error));
    }
    squared_focal += std::pow((solution.cameras.at(1).params[0] - truth.cameras.at(1).params[0]) /
                                  uncertainty.camera_sigmas.at(1)[0],
                              2);
    EXPECT_EQ(uncertainty.camera_sigmas.at(1)[1], 0.0);
  }
  // sigma / sqrt(2 redundancy): 400 residuals less 144 unknowns, over 100 solutions.
  // Outliers are no observations: by their share the information shrinks, the variance grows.
  const double sigma_px = kSigmaPx / std::sqrt(1.0 - GetParam().outlier_share);
  EXPECT_NEAR(sum_sigma_px / kNumSolutions, sigma_px, 0.01);
  const bool has_gauge = !GetParam().with_centre_priors;
  EXPECT_EQ(squared_distances.size(), has_gauge ? 3u : 5u);
  for (const auto& [image_id, sum] : squared_distances) {
    // Chi-squared of 6 degrees of freedom: mean 6, variance 12. Four sigmas of the mean of 100,
    // and 2 % for sigma_px, which is measured from each.
    EXPECT_NEAR(sum / kNumSolutions, 6.0, 4.0 * std::sqrt(12.0 / kNumSolutions) + 0.12) << image_id;
  }
  for (const auto& [image_id, squared] : squared_degs) {
    // The same for one degree of freedom, if the three axes err together.
    const double stated = stated_squared_degs.at(image_id);
    EXPECT_NEAR(squared, stated, (4.0 * std::sqrt(2.0 / kNumSolutions) + 0.02) * stated);
  }
  EXPECT_NEAR(squared_focal / kNumSolutions, 1.0, 4.0 * std::sqrt(2.0 / kNumSolutions) + 0.02);
}

INSTANTIATE_TEST_SUITE_P(Losses,
                         Uncertainties,
                         testing::Values(MonteCarlo{RobustLoss::kTrivial, false},
                                         MonteCarlo{RobustLoss::kCauchy, false},
                                         MonteCarlo{RobustLoss::kCauchy, false, 0.05},
                                         MonteCarlo{RobustLoss::kTrivial, true}));

Reconstruction NoisyModel() {
  SyntheticModelOptions model_options;
  model_options.num_points = 40;
  Reconstruction model = MakeSyntheticModel(model_options);
  ProjectAgain(model, 0.5, 2);
  EXPECT_TRUE(AdjustBundle({}, model).success);
  return model;
}

TEST(EstimateUncertainty, IsZeroWhereTheGaugeHolds) {
  const Uncertainty uncertainty = EstimateUncertainty({}, NoisyModel());
  ASSERT_TRUE(uncertainty.success);
  EXPECT_EQ(uncertainty.gauge.rfind("pose of image1.jpg, t", 0), 0u) << uncertainty.gauge;
  EXPECT_EQ(uncertainty.poses.at(1).rotation_deg, 0.0);
  EXPECT_EQ(uncertainty.poses.at(1).centre, 0.0);
  for (ImageId image_id = 2; image_id <= 6; ++image_id) {
    EXPECT_GT(uncertainty.poses.at(image_id).rotation_deg, 0.01);
    EXPECT_GT(uncertainty.poses.at(image_id).centre, 0.001);
  }
}

TEST(EstimateUncertainty, MovesWithTheWorld) {
  const Reconstruction model = NoisyModel();
  Reconstruction moved = model;
  const Sim3d moved_from_world = {
      20.0, RotationAboutAxis(Eigen::Vector3d::UnitX(), 50.0), {7.0, 100.0, -3.0}};
  Transform(moved_from_world, moved);
  const Uncertainty uncertainty = EstimateUncertainty({}, model);
  const Uncertainty moved_uncertainty = EstimateUncertainty({}, moved);
  Eigen::Matrix<double, 6, 6> change = Eigen::Matrix<double, 6, 6>::Identity();
  change.bottomRightCorner<3, 3>() = 20.0 * moved_from_world.rotation.toRotationMatrix();
  for (const auto& [image_id, pose] : uncertainty.poses) {
    const PoseUncertainty& moved_pose = moved_uncertainty.poses.at(image_id);
    const Eigen::Matrix<double, 6, 6> expected = change * pose.covariance * change.transpose();
    EXPECT_LE((moved_pose.covariance - expected).norm(), 1e-6 * expected.norm());
    EXPECT_NEAR(moved_pose.rotation_deg, pose.rotation_deg, 1e-6 * pose.rotation_deg);
    EXPECT_NEAR(moved_pose.centre, 20.0 * pose.centre, 2e-5 * pose.centre);
  }
}

// A view with its own focal length and three observations: six residuals for seven unknowns.
TEST(EstimateUncertainty, IsNaNForAViewThatIsUndetermined) {
  Reconstruction model = NoisyModel();
  for (uint32_t i = 3; i < 40; ++i) RemoveObservation(model, {4, i});
  const Uncertainty uncertainty = EstimateUncertainty({}, model);
  ASSERT_TRUE(uncertainty.success);
  EXPECT_TRUE(std::isnan(uncertainty.poses.at(4).rotation_deg));
  EXPECT_TRUE(std::isnan(uncertainty.poses.at(4).centre));
  EXPECT_TRUE(std::isnan(uncertainty.camera_sigmas.at(4)[0]));
  EXPECT_EQ(uncertainty.camera_sigmas.at(4)[2], 0.0);  // a principal point that is held
  EXPECT_GT(uncertainty.poses.at(5).rotation_deg, 0.01);
  EXPECT_GT(uncertainty.camera_sigmas.at(5)[0], 0.1);
}

TEST(EstimateUncertainty, SaysWhyThereIsNone) {
  const Reconstruction model = NoisyModel();
  UncertaintyOptions few;
  few.max_num_parameters = 40;
  // Five free poses, one of them with a held coordinate, and six cameras with two focal lengths.
  const Uncertainty refused = EstimateUncertainty({}, model, few);
  EXPECT_FALSE(refused.success);
  EXPECT_EQ(refused.message, "41 parameters of poses and intrinsics, 40 are allowed");
  EXPECT_EQ(EstimateUncertainty({}, {}).message, "no point is observed by two images");
  SyntheticModelOptions two;
  two.num_images = 2;
  two.num_points = 5;
  EXPECT_EQ(EstimateUncertainty({}, MakeSyntheticModel(two)).message,
            "there are no more residuals than unknowns");
  EXPECT_THROW(EstimateUncertainty({}, model, {0}), std::invalid_argument);
}

TEST(EstimateUncertainty, IsZeroForExactData) {
  const Uncertainty uncertainty = EstimateUncertainty({}, MakeSyntheticModel({}));
  ASSERT_TRUE(uncertainty.success);
  // Residuals of rounding size, 1e-13 px of a focal length of 500.
  EXPECT_LT(uncertainty.sigma_px, 1e-11);
  EXPECT_LT(uncertainty.poses.at(3).rotation_deg, 1e-11);
}

}  // namespace
}  // namespace vgtw
