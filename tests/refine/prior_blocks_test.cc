// SPDX-License-Identifier: BSD-3-Clause
#include "refine/prior_blocks.h"

#include "refine/bundle_adjustment.h"
#include "tests/refine/synthetic_priors.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Images 1 to 4 in component 0, 5 to 8 in component 1, 9 alone.
std::map<ImageId, LinkedImage> NineImages() {
  SyntheticModelOptions options;
  options.num_images = 9;
  options.num_points = 3;
  std::map<ImageId, LinkedImage> images;
  for (const auto& [image_id, image] : MakeSyntheticModel(options).images) {
    images[image_id] = {image.cam_from_world, (image_id - 1) / 4};
  }
  return images;
}

BundlePriors PosePriorsOf(const std::map<ImageId, LinkedImage>& images,
                          const std::vector<ImageId>& image_ids) {
  BundlePriors priors;
  for (const ImageId image_id : image_ids) {
    priors.poses.by_image[image_id] = {images.at(image_id).cam_from_world, 0.1, 0.01};
  }
  return priors;
}

BundlePriors CentrePriorsOf(const std::map<ImageId, LinkedImage>& images,
                            const std::vector<ImageId>& image_ids) {
  BundlePriors priors;
  for (const ImageId image_id : image_ids) {
    priors.centres.by_image[image_id] = {OriginInSource(images.at(image_id).cam_from_world),
                                         Eigen::Vector3d::Constant(0.01)};
  }
  return priors;
}

TEST(TieComponents, TwoPosesTieAComponent) {
  std::map<ImageId, LinkedImage> images = NineImages();
  const PriorTies ties = TieComponents(PosePriorsOf(images, {1, 2, 5, 9}), images);
  EXPECT_EQ(ties.poses, (std::vector<ImageId>{1, 2}));
  EXPECT_TRUE(ties.anchored.empty());
  EXPECT_NE(images.at(1).component, images.at(5).component);
}

TEST(TieComponents, ComponentsTiedToOneWorldBecomeOne) {
  std::map<ImageId, LinkedImage> images = NineImages();
  const PriorTies ties = TieComponents(PosePriorsOf(images, {1, 2, 5, 8, 9}), images);
  EXPECT_EQ(ties.poses, (std::vector<ImageId>{1, 2, 5, 8}));
  EXPECT_EQ(images.at(4).component, images.at(6).component);
  EXPECT_NE(images.at(4).component, images.at(9).component);
}

TEST(TieComponents, ThreeCentresTieAComponentUnlessOnALine) {
  std::map<ImageId, LinkedImage> images = NineImages();
  EXPECT_TRUE(TieComponents(CentrePriorsOf(images, {1, 2, 5}), images).centres.empty());
  const BundlePriors priors = CentrePriorsOf(images, {1, 2, 3});
  EXPECT_EQ(TieComponents(priors, images).centres.size(), 3u);
  BundlePriors line = priors;
  for (auto& [image_id, prior] : line.centres.by_image) {
    prior.centre_in_reference = Eigen::Vector3d(1.0, 2.0, 3.0) * image_id;
  }
  EXPECT_TRUE(TieComponents(line, images).centres.empty());
}

TEST(TieComponents, PriorsInTheModelsWorldAnchorWholeComponents) {
  std::map<ImageId, LinkedImage> images = NineImages();
  BundlePriors priors = CentrePriorsOf(images, {1, 2, 3});
  priors.centres.world = PriorWorld::kSame;
  // Poses of another world link the second component to the first.
  priors.poses = PosePriorsOf(images, {3, 4, 5, 6}).poses;
  const PriorTies ties = TieComponents(priors, images);
  EXPECT_EQ(ties.anchored, (std::set<ImageId>{1, 2, 3, 4, 5, 6, 7, 8}));
}

// Root mean square distance of points from the truth.
double PointError(const Reconstruction& model, const Reconstruction& truth) {
  double squared = 0.0;
  for (const auto& [point3D_id, point] : truth.points3D) {
    squared += (model.points3D.at(point3D_id).xyz - point.xyz).squaredNorm();
  }
  return std::sqrt(squared / static_cast<double>(truth.points3D.size()));
}

// Three cameras on an arc of 2 degrees, 4 away: pixels of sigma 1 know depths to about 4^2 / (500 *
// 0.14 * sqrt(3)) = 0.13, three priors of 2 % to 0.046.
TEST(PriorBlocks, DepthsPlacePointsOfSmallParallax) {
  SyntheticModelOptions model_options;
  model_options.num_images = 3;
  model_options.arc_deg = 2.0;
  const Reconstruction truth = MakeSyntheticModel(model_options);
  Reconstruction without = truth;
  ProjectAgain(without, 1.0, 20);
  BundleAdjustmentOptions options;
  options.refine_poses = false;
  options.refine_focal_length = false;
  Reconstruction with_priors = without;
  ASSERT_TRUE(AdjustBundle(options, without).success);
  options.priors.depths = DepthPriorsOf(truth, 0.02, 21);
  const BundleAdjustmentSummary summary = AdjustBundle(options, with_priors);
  ASSERT_TRUE(summary.success);
  EXPECT_NEAR(PointError(without, truth), 0.13, 0.02);
  EXPECT_LT(PointError(with_priors, truth), 0.046);
  // 360 depths of 2 %: 0.1 %, and the views' own scales and shifts.
  EXPECT_NEAR(*summary.priors.depth_scale, 0.5, 0.01);
}

TEST(PriorBlocks, DepthsMayHaveAScaleAndAShiftPerView) {
  const Reconstruction truth = MakeSyntheticModel({});
  BundleAdjustmentOptions options;
  options.refine_focal_length = false;
  options.priors.depths = DepthPriorsOf(truth, 0.0, 0);
  DepthPriors& depths = options.priors.depths;
  RandomStream random(22);
  for (auto& [image_id, priors] : depths.by_image) {
    const double scale = std::exp(0.2 * random.Normal());
    const double shift = 0.8 * random.Normal();
    for (DepthPrior& prior : priors) prior.depth = scale * prior.depth + shift;
  }
  depths.view_scale_log_sigma = 10.0;
  depths.view_shift_sigma = 10.0;
  Reconstruction adjusted = truth;
  const BundleAdjustmentSummary summary = AdjustBundle(options, adjusted);
  ASSERT_TRUE(summary.success);
  EXPECT_GT(summary.priors.depths.initial_rms, 5.0);
  // In sigmas of 1 %; the weak priors of scales and shifts pull by 1e-6 of the depths' weight.
  EXPECT_LT(summary.priors.depths.final_rms, 1e-3);
  EXPECT_LT(PointError(adjusted, truth), 1e-4);

  // The switches: neither alone explains both.
  for (const bool free_scales : {false, true}) {
    depths.free_view_scales = free_scales;
    depths.free_view_shifts = !free_scales;
    Reconstruction either = truth;
    EXPECT_GT(AdjustBundle(options, either).priors.depths.final_rms, 1.0);
  }
  depths.free_view_scales = false;
  Reconstruction neither = truth;
  EXPECT_EQ(AdjustBundle(options, neither).num_residuals, 1440u + 720u);
}

TEST(PriorBlocks, ADepthOfNoObservationIsRefused) {
  const Reconstruction model = MakeSyntheticModel({});
  BundlePriors priors;
  priors.depths.by_image[1] = {{120, 3.0, 0.1}};
  double pose[7] = {0, 0, 0, 1, 0, 0, 0};
  PriorTargets targets;
  targets.poses[1] = pose;
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(options);
  EXPECT_THROW(PriorBlocks(priors, {}, model, targets, problem), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
