// SPDX-License-Identifier: BSD-3-Clause
#include "refine/align.h"

#include "scene/random.h"
#include "scene/reprojection.h"
#include "tests/support/synthetic_model.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

const Sim3d kThereFromHere = {3.5, RotationAboutAxis({0.6, 0.0, 0.8}, 130.0), {20.0, -7.0, 4.0}};

void ExpectNear(const Sim3d& a, const Sim3d& b, double tolerance) {
  EXPECT_NEAR(a.scale / b.scale, 1.0, tolerance);
  EXPECT_LT(AngleBetweenDeg(a.rotation, b.rotation), 60.0 * tolerance);
  EXPECT_LT((a.translation - b.translation).norm() / (1.0 + b.translation.norm()), tolerance);
}

Reconstruction Moved(const Sim3d& b_from_a, Reconstruction model) {
  Transform(b_from_a, model);
  return model;
}

Reconstruction FirstImages(size_t num, const Reconstruction& model) {
  Reconstruction part = model;
  std::erase_if(part.images, [&](const auto& entry) { return entry.first > num; });
  return part;
}

// Cameras that look in different directions from `centres`.
Reconstruction CamerasAt(const std::vector<Eigen::Vector3d>& centres) {
  Reconstruction model;
  RandomStream random(1);
  for (const Eigen::Vector3d& centre : centres) {
    Image& image = model.images[static_cast<ImageId>(model.images.size() + 1)];
    const Eigen::Quaterniond rotation = random.Rotation();
    image.cam_from_world = {rotation, -(rotation * centre)};
  }
  return model;
}

// Angles come of arccos or arcsin of numbers that are exact to 1e-16: to 1e-8.
constexpr double kExact = 1e-8;

TEST(AlignPoses, RecoversASimilarity) {
  for (const size_t num_images : {2, 3, 10}) {
    SyntheticModelOptions options;
    options.num_images = static_cast<int>(num_images);
    const Reconstruction here = MakeSyntheticModel(options);
    const Reconstruction there = Moved(kThereFromHere, here);
    ExpectNear(AlignPoses(here, there), kThereFromHere, kExact);
    ExpectNear(AlignPoses(there, here), Inverse(kThereFromHere), kExact);
    ExpectNear(AlignPoses(here, here), {}, kExact);
  }
}

TEST(AlignPoses, FortyPercentOfWildViewsDoNotCount) {
  SyntheticModelOptions options;
  options.num_images = 10;
  const Reconstruction here = MakeSyntheticModel(options);
  for (uint64_t seed = 0; seed < 50; ++seed) {
    RandomStream random(seed);
    Reconstruction there = Moved(kThereFromHere, here);
    for (const ImageId id : {2, 5, 6, 9}) {
      there.images.at(id).cam_from_world = {random.Rotation(), 30.0 * random.NormalVector()};
    }
    // Absolute distances of six outweigh those of four; reweighting ends near that corner.
    ExpectNear(AlignPoses(here, there), kThereFromHere, 1e-4);
    ExpectNear(AlignPoses(here, there, {2, 5, 6, 9}), kThereFromHere, kExact);
  }
}

TEST(AlignPoses, CentresOnALineAreEnough) {
  const Reconstruction here = CamerasAt({{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {-1, -2, -3}});
  ExpectNear(AlignPoses(here, Moved(kThereFromHere, here)), kThereFromHere, kExact);
}

TEST(AlignPoses, CoincidentCentresKeepTheScale) {
  const Reconstruction here = CamerasAt({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}});
  const Reconstruction there = Moved(kThereFromHere, here);
  const Sim3d found = AlignPoses(here, there);
  EXPECT_EQ(found.scale, 1.0);
  EXPECT_LT(AngleBetweenDeg(found.rotation, kThereFromHere.rotation), 60.0 * kExact);
  const Eigen::Vector3d centre(1, 2, 3);
  EXPECT_LT((found * centre - kThereFromHere * centre).norm(), 1e-6);
  const Reconstruction origin = CamerasAt({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}});
  EXPECT_LT((AlignPoses(here, origin) * centre).norm(), 1e-12);
  const Sim3d one = AlignPoses(FirstImages(1, here), there);
  EXPECT_EQ(one.scale, 1.0);
  EXPECT_LT((one * centre - kThereFromHere * centre).norm(), 1e-6);
}

TEST(AlignPoses, OnlyCommonImagesCount) {
  const Reconstruction here = MakeSyntheticModel({});
  const Reconstruction there = Moved(kThereFromHere, here);
  Reconstruction other = FirstImages(3, there);
  other.images[99] = there.images.at(6);
  ExpectNear(AlignPoses(here, other), kThereFromHere, kExact);
  // Nothing common: the identity.
  for (const Sim3d& none :
       {AlignPoses(here, {}), AlignPoses({}, here), AlignPoses(here, there, {1, 2, 3, 4, 5, 6})}) {
    EXPECT_EQ(none.scale, 1.0);
    EXPECT_EQ(none.rotation.coeffs(), Eigen::Quaterniond::Identity().coeffs());
    EXPECT_EQ(none.translation, Eigen::Vector3d(0.0, 0.0, 0.0));
  }
}

TEST(AlignPoses, NoiseOfViewsAveragesOut) {
  SyntheticModelOptions options;
  options.num_images = 40;
  const Reconstruction here = MakeSyntheticModel(options);
  for (unsigned seed = 0; seed < 5; ++seed) {
    Reconstruction noisy = here;
    PerturbPoses(noisy, 1.0, 0.1, seed);
    const Sim3d found = AlignPoses(noisy, here);
    // Medians of 40: 0.2 of one view's error, three sigmas of that.
    EXPECT_LT(AngleBetweenDeg(found.rotation, Eigen::Quaterniond::Identity()), 0.6);
    EXPECT_NEAR(found.scale, 1.0, 0.03);
    EXPECT_LT((found * Eigen::Vector3d(0, 0, 0)).norm(), 0.1);
  }
}

TEST(Transform, KeepsReprojectionErrors) {
  Reconstruction model = MakeSyntheticModel({});
  ProjectAgain(model, 3.0, 1);
  Reconstruction moved = model;
  Transform(kThereFromHere, moved);
  EXPECT_EQ(FindFault(moved), "");
  for (const auto& [id, image] : model.images) {
    const Image& other = moved.images.at(id);
    EXPECT_LT((OriginInSource(other.cam_from_world) -
               kThereFromHere * OriginInSource(image.cam_from_world))
                  .norm(),
              1e-12);
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      // Coordinates of 20 are stored to 4e-15 of 500 px at a distance of 14.
      EXPECT_NEAR(*ReprojectionError(moved, other, other.points2D[i]),
                  *ReprojectionError(model, image, image.points2D[i]),
                  1e-10);
    }
  }
}

}  // namespace
}  // namespace vgtw
