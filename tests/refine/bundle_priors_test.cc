// SPDX-License-Identifier: BSD-3-Clause
#include "refine/bundle_priors.h"

#include "evaluation/pose_error.h"
#include "refine/align.h"
#include "refine/bundle_adjustment.h"
#include "refine/uncertainty.h"
#include "scene/random.h"
#include "tests/refine/synthetic_priors.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

PoseComparison Compare(const Reconstruction& estimate, const Reconstruction& truth) {
  return ComparePoses(CamFromWorldByName(estimate), CamFromWorldByName(truth)).value();
}

void ExpectSameSimilarity(const Sim3d& a, const Sim3d& b, double tolerance) {
  EXPECT_NEAR(a.scale / b.scale, 1.0, tolerance);
  EXPECT_LT(AngleBetweenDeg(a.rotation, b.rotation), 57.3 * tolerance);
  EXPECT_LT((a.translation - b.translation).norm(), 10.0 * tolerance);
}

TEST(BundlePriors, ExactOnesLeaveTheTruthWhereItIs) {
  const Reconstruction truth = MakeSyntheticModel({});
  BundleAdjustmentOptions options;
  options.priors = ExactPriors(truth);
  Reconstruction adjusted = truth;
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  EXPECT_TRUE(summary.success) << summary.message;
  // Pixels: 1440 residuals; poses: 6 images of 6; centres: 6 of 3; focal lengths: 6 cameras of 2;
  // depths: 720 and two per view for scale and shift.
  EXPECT_EQ(summary.num_residuals, 1440u + 36u + 18u + 12u + 720u + 12u);
  EXPECT_LT(summary.initial_cost, 1e-20);
  EXPECT_LT(Compare(adjusted, truth).centre_rmse, 1e-10);
  for (const PriorGroupSummary* group : {&summary.priors.rotations,
                                         &summary.priors.pose_centres,
                                         &summary.priors.centres,
                                         &summary.priors.focal_lengths,
                                         &summary.priors.depths}) {
    EXPECT_LT(group->initial_rms, 1e-9);
    EXPECT_LT(group->final_rms, 1e-9);
    EXPECT_EQ(group->message, "");
  }
  EXPECT_EQ(summary.priors.depths.num_priors, 720u);
  ExpectSameSimilarity(*summary.priors.poses_reference_from_world, kReferenceFromWorld, 1e-9);
  ExpectSameSimilarity(*summary.priors.centres_reference_from_world, kReferenceFromWorld, 1e-9);
  EXPECT_NEAR(*summary.priors.depth_scale, 0.5, 1e-9);
}

TEST(BundlePriors, ExactOnesAreReachedFromAPerturbedStart) {
  const Reconstruction truth = MakeSyntheticModel({});
  BundleAdjustmentOptions options;
  options.priors = ExactPriors(truth);
  options.max_num_iterations = 200;
  Reconstruction adjusted = truth;
  PerturbPoses(adjusted, 1.0, 0.1, 1);
  PerturbPoints(adjusted, 0.05, 2);
  for (auto& [camera_id, camera] : adjusted.cameras) camera.SetFocalLength(520.0, 510.0);
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  EXPECT_TRUE(summary.success) << summary.message;
  EXPECT_LT(summary.final_cost, 1e-9 * summary.initial_cost);
  EXPECT_GT(summary.priors.pose_centres.initial_rms, 1.0);
  // As near as exact pixels allow, see bundle_adjustment_test.
  EXPECT_LT(Compare(adjusted, truth).centre_rmse_percent, 1e-6);
  EXPECT_LT(summary.priors.depths.final_rms, 1e-6);
}

// Where the similarity is free, the world of the model is of no consequence.
TEST(BundlePriors, ASimilarityOfTheModelChangesNothing) {
  const Reconstruction truth = MakeSyntheticModel({});
  BundleAdjustmentOptions options;
  options.priors = ExactPriors(truth);
  options.priors.poses = PosePriorsOf(truth, {0.3, 0.05}, 3);
  options.priors.centres = CentrePriorsOf(truth, 0.05, 4);
  options.priors.depths = DepthPriorsOf(truth, 0.05, 5);
  options.function_tolerance = 1e-14;
  Reconstruction start = truth;
  ProjectAgain(start, 0.5, 6);
  Reconstruction moved = start;
  Transform({0.01, kReferenceFromWorld.rotation, {100.0, 50.0, -20.0}}, moved);
  const BundleAdjustmentSummary summary = AdjustBundle(options, start);
  const BundleAdjustmentSummary moved_summary = AdjustBundle(options, moved);
  ASSERT_TRUE(summary.success && moved_summary.success);
  EXPECT_NEAR(moved_summary.initial_cost / summary.initial_cost, 1.0, 1e-9);
  EXPECT_NEAR(moved_summary.final_cost / summary.final_cost, 1.0, 1e-9);
  EXPECT_NEAR(*moved_summary.priors.depth_scale / *summary.priors.depth_scale, 0.01, 1e-6);
  // What 1e-14 of the cost still leaves open of the poses.
  EXPECT_LT(Compare(moved, start).centre_rmse_percent, 1e-3);
}

// Distance of an image's centre from the truth, aligned by the other images.
double CentreError(const Reconstruction& model, const Reconstruction& truth, ImageId image_id) {
  std::vector<Eigen::Vector3d> centres, true_centres;
  for (const auto& [other_id, image] : truth.images) {
    if (other_id == image_id) continue;
    centres.push_back(OriginInSource(model.images.at(other_id).cam_from_world));
    true_centres.push_back(OriginInSource(image.cam_from_world));
  }
  const Sim3d truth_from_model = EstimateSim3d(centres, true_centres).value();
  return (truth_from_model * OriginInSource(model.images.at(image_id).cam_from_world) -
          OriginInSource(truth.images.at(image_id).cam_from_world))
      .norm();
}

// Root mean square over 8 scenes of the error of an image with few observations of 1 px, its pose
// adjusted from a wrong start with the priors that `make_priors(truth, seed)` gives, and without.
struct WeakViewErrors {
  double with_priors = 0.0;
  double without = 0.0;
};
template <typename MakePriors>
WeakViewErrors AdjustWeakViews(uint32_t num_observations, const MakePriors& make_priors) {
  constexpr unsigned kNumScenes = 8;
  constexpr ImageId kWeak = 3;
  WeakViewErrors squared;
  for (unsigned seed = 0; seed < kNumScenes; ++seed) {
    SyntheticModelOptions model_options;
    model_options.seed = seed;
    model_options.num_points = 60;
    const Reconstruction truth = MakeSyntheticModel(model_options);
    Reconstruction without = truth;
    ProjectAgain(without, 1.0, seed);
    PerturbPoses(without, 0.2, 0.05, seed);
    for (uint32_t i = num_observations; i < 60; ++i) RemoveObservation(without, {kWeak, i});
    Reconstruction with_priors = without;
    BundleAdjustmentOptions options;
    options.refine_focal_length = false;
    EXPECT_TRUE(AdjustBundle(options, without).success);
    options.priors = make_priors(truth, seed);
    EXPECT_TRUE(AdjustBundle(options, with_priors).success);
    squared.with_priors += std::pow(CentreError(with_priors, truth, kWeak), 2) / kNumScenes;
    squared.without += std::pow(CentreError(without, truth, kWeak), 2) / kNumScenes;
  }
  return {std::sqrt(squared.with_priors), std::sqrt(squared.without)};
}

TEST(BundlePriors, PosesBringAWeakViewNearerToTheTruth) {
  for (const uint32_t num_observations : {3, 5, 10}) {
    const WeakViewErrors errors =
        AdjustWeakViews(num_observations, [](const Reconstruction& truth, unsigned seed) {
          BundlePriors priors;
          priors.poses = PosePriorsOf(truth, {0.2, 0.03}, seed);
          return priors;
        });
    SCOPED_TRACE(num_observations);
    EXPECT_LT(errors.with_priors, errors.without);
    // Nor is it worse than the priors alone, of three axes with this sigma each.
    EXPECT_LT(errors.with_priors, std::sqrt(3.0) * 0.03);
  }
}

TEST(BundlePriors, KnownCentresBringAWeakViewNearerToTheTruth) {
  const WeakViewErrors errors = AdjustWeakViews(4, [](const Reconstruction& truth, unsigned seed) {
    BundlePriors priors;
    priors.centres = CentrePriorsOf(truth, 0.02, seed);
    return priors;
  });
  EXPECT_LT(errors.with_priors, errors.without);
  // What the prior and an alignment by five others leave, and 15 % for chance in 24 coordinates.
  EXPECT_LT(errors.with_priors, 1.15 * std::sqrt(3.0 * (1.0 + 1.0 / 5.0)) * 0.02);
}

TEST(BundlePriors, ATwentiethOfWildOnesDoesNoHarm) {
  SyntheticModelOptions model_options;
  model_options.num_images = 20;
  const Reconstruction truth = MakeSyntheticModel(model_options);
  Reconstruction start = truth;
  ProjectAgain(start, 0.5, 7);
  PerturbPoses(start, 0.2, 0.02, 8);
  BundleAdjustmentOptions options;
  options.refine_focal_length = false;
  options.priors.poses = PosePriorsOf(truth, {0.2, 0.03}, 9);
  options.priors.centres = CentrePriorsOf(truth, 0.03, 10);
  options.priors.depths = DepthPriorsOf(truth, 0.05, 11);
  Reconstruction right = start;
  ASSERT_TRUE(AdjustBundle(options, right).success);

  options.priors.poses.by_image.at(7).cam_from_reference =
      TransformCamera(kReferenceFromWorld, truth.images.at(15).cam_from_world);
  options.priors.centres.by_image.at(12).centre_in_reference += Eigen::Vector3d(5.0, 20.0, 0.0);
  RandomStream random(12);
  for (auto& [image_id, depths] : options.priors.depths.by_image) {
    for (DepthPrior& depth : depths) {
      if (random.Uniform() < 0.05) depth.depth *= random.Uniform(1.5, 10.0);
    }
  }
  Reconstruction wrong = start;
  ASSERT_TRUE(AdjustBundle(options, wrong).success);
  // Within a tenth of the error that right priors leave: the wrong ones weigh
  // 1 / (1 + (r / 3)^2) < 1 % beside 2400 pixels.
  EXPECT_LT(Compare(wrong, truth).centre_rmse, 1.1 * Compare(right, truth).centre_rmse);
}

TEST(BundlePriors, KnownCentresBringAModelToMetricScale) {
  const Reconstruction truth = MakeSyntheticModel({});
  Reconstruction metric_truth = truth;
  Transform(kReferenceFromWorld, metric_truth);
  BundleAdjustmentOptions options;
  options.refine_focal_length = false;
  options.priors.centres = CentrePriorsOf(truth, 0.01, 13);
  Reconstruction adjusted = truth;
  ProjectAgain(adjusted, 0.3, 14);
  PerturbPoses(adjusted, 0.2, 0.02, 15);

  // By the similarity that the summary reports.
  Reconstruction free = adjusted;
  const BundleAdjustmentSummary free_summary = AdjustBundle(options, free);
  ASSERT_TRUE(free_summary.success);
  Transform(*free_summary.priors.centres_reference_from_world, free);

  // Or by going there first; the priors then are the gauge.
  Transform(EstimateReferenceFromWorld(options.priors.centres, PosesOf(adjusted)).value(),
            adjusted);
  options.priors.centres.world = PriorWorld::kSame;
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  ASSERT_TRUE(summary.success);
  EXPECT_EQ(summary.gauge, "the world of the priors");
  EXPECT_EQ(summary.priors.centres_reference_from_world->scale, 1.0);

  for (const auto& [image_id, image] : metric_truth.images) {
    const Eigen::Vector3d centre = OriginInSource(image.cam_from_world);
    // Six centres of sigma 0.025 per axis: their world is known to about 0.025 sqrt(7 / 6), and a
    // centre errs by three axes of that at most thrice.
    const Eigen::Vector3d adjusted_centre =
        OriginInSource(adjusted.images.at(image_id).cam_from_world);
    EXPECT_LT((adjusted_centre - centre).norm(), 0.1);
    // Both ways minimise the same.
    EXPECT_LT((OriginInSource(free.images.at(image_id).cam_from_world) - adjusted_centre).norm(),
              1e-4);
  }
  EXPECT_NEAR(summary.final_cost / free_summary.final_cost, 1.0, 1e-6);
}

// Two groups of images without a common point are placed by the world of their priors.
TEST(BundlePriors, TieGroupsThatShareNoPoint) {
  SyntheticModelOptions model_options;
  model_options.num_images = 8;
  const Reconstruction truth = MakeSyntheticModel(model_options);
  Reconstruction start = truth;
  for (auto& [point3D_id, point] : truth.points3D) {
    for (const TrackElement& element : point.track) {
      if ((element.image_id <= 4) != (point3D_id % 2 == 0)) RemoveObservation(start, element);
    }
  }
  // The second group stands elsewhere and is larger.
  Reconstruction moved = start;
  Transform({1.1, RotationAboutAxis(Eigen::Vector3d::UnitY(), 4.0), {0.3, 0.1, -0.2}}, moved);
  for (auto& [image_id, image] : start.images) {
    if (image_id > 4) image.cam_from_world = moved.images.at(image_id).cam_from_world;
  }
  for (auto& [point3D_id, point] : start.points3D) {
    if (point3D_id % 2 == 1) point.xyz = moved.points3D.at(point3D_id).xyz;
  }
  BundleAdjustmentOptions options;
  options.refine_focal_length = false;
  Reconstruction untied = start;
  AdjustBundle(options, untied);
  EXPECT_GT(Compare(untied, truth).centre_rmse_percent, 1.0);
  options.priors.poses = PosePriorsOf(truth, {}, 0);
  options.max_num_iterations = 200;
  Reconstruction tied = start;
  const BundleAdjustmentSummary summary = AdjustBundle(options, tied);
  EXPECT_TRUE(summary.success) << summary.message;
  // Exact priors, but the losses are flat far from them: what function_tolerance leaves.
  EXPECT_LT(Compare(tied, truth).centre_rmse_percent, 1e-3);
}

TEST(BundlePriors, SayWhyTheyTakeNoPart) {
  const Reconstruction truth = MakeSyntheticModel({});
  BundleAdjustmentOptions options;
  options.priors = ExactPriors(truth);
  std::erase_if(options.priors.poses.by_image, [](const auto& prior) { return prior.first > 1; });
  std::erase_if(options.priors.centres.by_image, [](const auto& prior) { return prior.first > 2; });
  Reconstruction adjusted = truth;
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  EXPECT_NE(summary.priors.rotations.message.find("fewer than two"), std::string::npos);
  EXPECT_NE(summary.priors.centres.message.find("fewer than three"), std::string::npos);
  EXPECT_EQ(summary.priors.pose_centres.num_priors, 0u);
  EXPECT_FALSE(summary.priors.poses_reference_from_world.has_value());
}

TEST(BundlePriors, RefuseWhatIsNoPrior) {
  const Reconstruction truth = MakeSyntheticModel({});
  const BundlePriors right = ExactPriors(truth);
  EXPECT_NO_THROW(right.Check());
  BundlePriors wrong = right;
  wrong.poses.by_image.at(1).centre_sigma = 0.0;
  EXPECT_THROW(wrong.Check(), std::invalid_argument);
  wrong = right;
  wrong.poses.by_image.at(1).cam_from_reference.translation.x() =
      std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(wrong.Check(), std::invalid_argument);
  wrong = right;
  wrong.centres.by_image.at(2).sigma.y() = -1.0;
  EXPECT_THROW(wrong.Check(), std::invalid_argument);
  wrong = right;
  wrong.focal_lengths.at(1).focal_length_x = 0.0;
  EXPECT_THROW(wrong.Check(), std::invalid_argument);
  wrong = right;
  wrong.depths.by_image.at(1).front().depth = std::numeric_limits<double>::infinity();
  EXPECT_THROW(wrong.Check(), std::invalid_argument);
  wrong = right;
  wrong.sigma_px = 0.0;
  EXPECT_THROW(wrong.Check(), std::invalid_argument);
}

// Priors whose errors are three times what they state, measured thrice.
TEST(MeasuredSigmaFactor, MeasuresThePriorsOfAnAdjustment) {
  SyntheticModelOptions model_options;
  model_options.num_images = 30;
  const Reconstruction truth = MakeSyntheticModel(model_options);
  BundleAdjustmentOptions options;
  options.refine_focal_length = false;
  options.priors.poses = PosePriorsOf(truth, {0.6, 0.06}, 23);
  double rotations = 1.0 / 3.0;
  double centres = 1.0 / 3.0;
  for (int round = 0; round < 4; ++round) {
    for (auto& [image_id, prior] : options.priors.poses.by_image) {
      prior.rotation_sigma_deg = 0.6 * rotations;
      prior.centre_sigma = kReferenceFromWorld.scale * 0.06 * centres;
    }
    Reconstruction adjusted = truth;
    ProjectAgain(adjusted, 0.5, 24);
    const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
    ASSERT_TRUE(summary.success);
    const PriorRedundancies redundancies =
        EstimateUncertainty(options, adjusted).prior_redundancies;
    MeasuredSigmaOptions measured;
    measured.redundancy = redundancies.rotations;
    rotations *= MeasuredSigmaFactor(summary.priors.rotations.residuals, measured);
    measured.redundancy = redundancies.pose_centres;
    centres *= MeasuredSigmaFactor(summary.priors.pose_centres.residuals, measured);
  }
  // The median of 90 residuals has a sigma of 12 %.
  EXPECT_NEAR(rotations, 1.0, 0.24);
  EXPECT_NEAR(centres, 1.0, 0.24);
}

TEST(EstimateReferenceFromWorld, SurvivesAThirdOfWrongPriors) {
  SyntheticModelOptions model_options;
  model_options.num_images = 12;
  const Reconstruction truth = MakeSyntheticModel(model_options);
  PosePriors poses = PosePriorsOf(truth, {0.2, 0.02}, 16);
  CentrePriors centres = CentrePriorsOf(truth, 0.02, 17);
  RandomStream random(18);
  for (const ImageId image_id : {1, 4, 6, 11}) {
    const Eigen::Quaterniond rotation = random.Rotation();
    poses.by_image.at(image_id).cam_from_reference = {rotation, 9.0 * random.NormalVector()};
    centres.by_image.at(image_id).centre_in_reference += 9.0 * random.NormalVector();
  }
  // A start for adjustment: it need only be nearer than the losses reach.
  const Sim3d by_poses = EstimateReferenceFromWorld(poses, PosesOf(truth)).value();
  EXPECT_LT(AngleBetweenDeg(by_poses.rotation, kReferenceFromWorld.rotation), 0.5);
  EXPECT_NEAR(by_poses.scale / kReferenceFromWorld.scale, 1.0, 0.05);
  const Sim3d by_centres = EstimateReferenceFromWorld(centres, PosesOf(truth)).value();
  EXPECT_LT(AngleBetweenDeg(by_centres.rotation, kReferenceFromWorld.rotation), 2.0);
  EXPECT_NEAR(by_centres.scale / kReferenceFromWorld.scale, 1.0, 0.03);
}

TEST(MeasuredSigmaFactor, IsTheSigmaOfManyResiduals) {
  RandomStream random(19);
  std::vector<double> residuals;
  for (int i = 0; i < 10000; ++i) residuals.push_back(2.5 * random.Normal());
  // The median's own sigma is 1.17 / sqrt(n) of it: 3 sigmas are 3.5 %.
  EXPECT_NEAR(MeasuredSigmaFactor(residuals), 2.5, 0.035 * 2.5);
  // A tenth of them wild shifts the median to the 55.6th percentile of the others: 0.765 sigmas.
  for (int i = 0; i < 1000; ++i) residuals[i * 10] = 1000.0;
  EXPECT_NEAR(MeasuredSigmaFactor(residuals), 2.5 * 1.4826 * 0.765, 0.035 * 2.84);
}

TEST(MeasuredSigmaFactor, StaysNearTheStatedOneForFew) {
  EXPECT_EQ(MeasuredSigmaFactor({}), 1.0);
  // sqrt((3 (1.4826 * 4)^2 + 10) / 13) = sqrt(115.514 / 13)
  EXPECT_NEAR(MeasuredSigmaFactor({4.0, -4.0, 4.0}), 2.98087, 1e-4);
  // Perfect agreement of many is no proof of perfect priors: sqrt((990 * 0.01 + 10) / 1000).
  EXPECT_NEAR(MeasuredSigmaFactor(std::vector<double>(990, 0.0)), 0.141067, 1e-6);
  // Residuals that are a fifth of the errors, and those of priors that have their way.
  EXPECT_NEAR(
      MeasuredSigmaFactor(std::vector<double>(1000, 1.0), {0.1, 0.0, 0.04}), 1.4826 / 0.2, 1e-9);
  EXPECT_EQ(MeasuredSigmaFactor(std::vector<double>(1000, 0.0), {0.1, 10.0, 0.0}), 1.0);
  EXPECT_THROW(MeasuredSigmaFactor({1.0}, {0.0, 10.0}), std::invalid_argument);
  EXPECT_THROW(MeasuredSigmaFactor({1.0}, {0.1, 10.0, 1.1}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
