// SPDX-License-Identifier: BSD-3-Clause
#include "refine/prior_blocks.h"

#include "tests/support/synthetic_model.h"

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
