// SPDX-License-Identifier: BSD-3-Clause
#include "scene/reprojection.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Pixels are sums of small decimals; errors of size 10 are exact to some 1e-14.
constexpr double kRounding = 1e-12;

// One point at (0, 0, 5) on the axis of every image, so that it projects to (50, 40); image i
// observes it `errors[i]` pixels away. A negative error stands for an image that looks away.
Reconstruction MakeModel(const std::vector<double>& errors) {
  Reconstruction model;
  model.cameras[1] = MakePinhole(100, 80, 90, 90);
  model.cameras[1].camera_id = 1;
  Point3D& point = model.points3D[1];
  point.xyz = {0, 0, 5};
  for (size_t i = 0; i < errors.size(); ++i) {
    const auto image_id = static_cast<ImageId>(i + 1);
    Image& image = model.images[image_id];
    image.image_id = image_id;
    image.camera_id = 1;
    if (errors[i] < 0) {
      image.cam_from_world.rotation = RotationAboutAxis(Eigen::Vector3d::UnitY(), 180.0);
    }
    image.points2D = {{{50 + 0.6 * errors[i], 40 - 0.8 * errors[i]}, 1}};
    point.track.push_back({image_id, 0});
  }
  return model;
}

TEST(ReprojectionError, IsTheDistanceInPixels) {
  const Reconstruction model = MakeModel({5.0, -1.0});
  const Image& image = model.images.at(1);
  EXPECT_NEAR(ReprojectionError(model, image, image.points2D[0]).value(), 5.0, kRounding);
  const Image& turned = model.images.at(2);
  EXPECT_FALSE(ReprojectionError(model, turned, turned.points2D[0]));
  EXPECT_THROW(ReprojectionError(model, image, Point2D()), std::invalid_argument);
}

TEST(ReprojectionStats, AreHandComputed) {
  // Sorted 1 2 3 4 10: the 90th percentile lies 0.6 of the way from 4 to 10.
  const auto odd = ComputeReprojectionStats(MakeModel({4, 1, 10, -1, 2, 3, -1}));
  EXPECT_EQ(odd.num_images, 7u);
  EXPECT_EQ(odd.num_points3D, 1u);
  EXPECT_EQ(odd.num_observations, 7u);
  EXPECT_EQ(odd.num_behind_camera, 2u);
  EXPECT_NEAR(odd.median_px, 3.0, kRounding);
  EXPECT_NEAR(odd.mean_px, 4.0, kRounding);
  EXPECT_NEAR(odd.p90_px, 7.6, kRounding);
  EXPECT_EQ(odd.mean_track_length, 7.0);
  EXPECT_NEAR(ComputeReprojectionStats(MakeModel({4, 1, 10, 2})).median_px, 3.0, kRounding);
}

TEST(ReprojectionStats, OfNothingAreZero) {
  const auto empty = ComputeReprojectionStats(Reconstruction());
  EXPECT_EQ(empty.num_observations, 0u);
  EXPECT_EQ(empty.mean_px, 0.0);
  EXPECT_EQ(empty.mean_track_length, 0.0);
  const auto behind = ComputeReprojectionStats(MakeModel({-1, -1}));
  EXPECT_EQ(behind.num_behind_camera, 2u);
  EXPECT_EQ(behind.median_px, 0.0);
}

TEST(ReprojectionStats, RefuseBrokenModels) {
  Reconstruction model = MakeModel({1, 2});
  model.images.erase(2);
  EXPECT_THROW(ComputeReprojectionStats(model), std::invalid_argument);
  model = MakeModel({1, 2});
  model.images[2].points2D.clear();
  EXPECT_THROW(ComputeReprojectionStats(model), std::invalid_argument);
  model = MakeModel({1, 2});
  model.cameras.clear();
  EXPECT_THROW(ComputeReprojectionStats(model), std::invalid_argument);
}

TEST(UpdatePointErrors, TakesTheMeanInFrontOfCameras) {
  Reconstruction model = MakeModel({1, -1, 4});
  UpdatePointErrors(model);
  EXPECT_NEAR(model.points3D[1].error, 2.5, kRounding);
  model = MakeModel({-1, -1});
  model.points3D[1].error = 3.0;
  UpdatePointErrors(model);
  EXPECT_EQ(model.points3D[1].error, -1.0);
}

}  // namespace
}  // namespace vgtw
