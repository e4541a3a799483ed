// SPDX-License-Identifier: BSD-3-Clause
#include "refine/bundle_priors.h"

#include "evaluation/pose_error.h"
#include "refine/align.h"
#include "refine/bundle_adjustment.h"
#include "scene/random.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Some world that is not the model's.
const Sim3d kReferenceFromWorld = {
    2.5, RotationAboutAxis(Eigen::Vector3d(1.0, -2.0, 0.5).normalized(), 70.0), {10.0, -4.0, 3.0}};

std::map<ImageId, Rigid3d> PosesOf(const Reconstruction& model) {
  std::map<ImageId, Rigid3d> poses;
  for (const auto& [image_id, image] : model.images) poses[image_id] = image.cam_from_world;
  return poses;
}

// Errors of this size in the priors, which state it as their sigma.
struct PriorErrors {
  double rotation_deg = 0.0;
  double centre = 0.0;  // per axis, in units of the model
};
constexpr PriorErrors kStatedForExact = {0.1, 0.01};

PosePriors PosePriorsOf(const Reconstruction& truth, const PriorErrors& errors, uint64_t seed) {
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

CentrePriors CentrePriorsOf(const Reconstruction& truth, double sigma, uint64_t seed) {
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

std::map<CameraId, FocalPrior> FocalPriorsOf(const Reconstruction& truth) {
  std::map<CameraId, FocalPrior> priors;
  for (const auto& [camera_id, camera] : truth.cameras) {
    priors[camera_id] = {camera.FocalLengthX(), camera.FocalLengthY(), 0.01};
  }
  return priors;
}

// Depths of the truth in a unit that is half the scene's.
DepthPriors DepthPriorsOf(const Reconstruction& truth, double log_sigma, uint64_t seed) {
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

BundlePriors ExactPriors(const Reconstruction& truth) {
  BundlePriors priors;
  priors.poses = PosePriorsOf(truth, {}, 0);
  priors.centres = CentrePriorsOf(truth, 0.0, 0);
  priors.focal_lengths = FocalPriorsOf(truth);
  priors.depths = DepthPriorsOf(truth, 0.0, 0);
  return priors;
}

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

// The share of `weak` in the error of an image's centre, over the truth's extent.
double WeakError(const Reconstruction& model, const Reconstruction& truth, ImageId weak) {
  // The other five images define the alignment.
  std::vector<Eigen::Vector3d> centres, true_centres;
  for (const auto& [image_id, image] : truth.images) {
    if (image_id == weak) continue;
    centres.push_back(OriginInSource(model.images.at(image_id).cam_from_world));
    true_centres.push_back(OriginInSource(image.cam_from_world));
  }
  const Sim3d truth_from_model = EstimateSim3d(centres, true_centres).value();
  return (truth_from_model * OriginInSource(model.images.at(weak).cam_from_world) -
          OriginInSource(truth.images.at(weak).cam_from_world))
      .norm();
}

// All but the first `num_kept` observations of an image removed.
void Weaken(Reconstruction& model, ImageId image_id, size_t num_kept) {
  for (uint32_t i = static_cast<uint32_t>(num_kept); i < model.images.at(image_id).points2D.size();
       ++i) {
    RemoveObservation(model, {image_id, i});
  }
}

TEST(BundlePriors, AWeakViewEndsNearerToTheTruth) {
  const PriorErrors errors = {0.2, 0.03};
  for (const size_t num_observations : {3, 5, 10}) {
    double with_squared = 0.0;
    double without_squared = 0.0;
    for (unsigned seed = 0; seed < 8; ++seed) {
      SyntheticModelOptions model_options;
      model_options.seed = seed;
      model_options.num_points = 60;
      const Reconstruction truth = MakeSyntheticModel(model_options);
      const PosePriors priors = PosePriorsOf(truth, errors, seed);
      Reconstruction start = truth;
      ProjectAgain(start, 1.0, seed);
      for (auto& [image_id, image] : start.images) {
        // As a seed is: at the poses of the priors.
        image.cam_from_world = TransformCamera(Inverse(kReferenceFromWorld),
                                               priors.by_image.at(image_id).cam_from_reference);
      }
      Weaken(start, 3, num_observations);
      BundleAdjustmentOptions options;
      options.refine_focal_length = false;
      Reconstruction without = start;
      ASSERT_TRUE(AdjustBundle(options, without).success);
      options.priors.poses = priors;
      Reconstruction with = start;
      ASSERT_TRUE(AdjustBundle(options, with).success);
      with_squared += std::pow(WeakError(with, truth, 3), 2);
      without_squared += std::pow(WeakError(without, truth, 3), 2);
    }
    SCOPED_TRACE(num_observations);
    EXPECT_LT(with_squared, without_squared);
    // Nor is it worse than the priors alone, of three axes with this sigma each.
    EXPECT_LT(std::sqrt(with_squared / 20.0), std::sqrt(3.0) * errors.centre);
  }
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
  EXPECT_THROW(MeasuredSigmaFactor({1.0}, {0.0, 10.0}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
