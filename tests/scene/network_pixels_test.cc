// SPDX-License-Identifier: BSD-3-Clause
#include "scene/network_pixels.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Params = std::vector<double>;

Eigen::Matrix3d Intrinsics(double fx, double fy, double cx, double cy) {
  Eigen::Matrix3d k;
  k << fx, 0, cx, 0, fy, cy, 0, 0, 1;
  return k;
}

TEST(CameraFromNetwork, CropIsUndoneExactly) {
  // 1200x1600 in crop mode: 518 x 686, rows 84..602. cy = (259 + 84) * 1600 / 686 = 800.
  const NetworkGeometry geometry = MakeNetworkGeometry(ResizePolicy::kCrop, 1200, 1600, 518, 0);
  const auto camera = CameraFromNetwork(Intrinsics(518, 343, 259, 259), geometry, {1200, 1600});
  ASSERT_TRUE(camera);
  EXPECT_EQ(camera->model, CameraModel::kPinhole);
  EXPECT_EQ(camera->width, 1200u);
  EXPECT_EQ(camera->height, 1600u);
  EXPECT_TRUE(camera->has_prior_focal_length);
  const Params expected = {1200, 800, 600, 800};
  for (size_t i = 0; i < 4; ++i) EXPECT_NEAR(camera->params[i], expected[i], 1e-9);
}

TEST(CameraFromNetwork, BadIntrinsicsGiveNone) {
  const NetworkGeometry geometry = MakeNetworkGeometry(ResizePolicy::kCrop, 706, 529, 518, 0);
  const ImageSize size = {706, 529};
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(CameraFromNetwork(Intrinsics(400, 400, 259, 196), geometry, size));
  EXPECT_FALSE(CameraFromNetwork(Intrinsics(inf, 400, 259, 196), geometry, size));
  EXPECT_FALSE(CameraFromNetwork(Intrinsics(0, 400, 259, 196), geometry, size));
  EXPECT_FALSE(CameraFromNetwork(Intrinsics(400, -1, 259, 196), geometry, size));
  Eigen::Matrix3d skewed = Intrinsics(400, 400, 259, 196);
  skewed(0, 1) = 4.0;
  EXPECT_FALSE(CameraFromNetwork(skewed, geometry, size));
  Eigen::Matrix3d last_row = Intrinsics(400, 400, 259, 196);
  last_row(2, 2) = 0.0;
  EXPECT_FALSE(CameraFromNetwork(last_row, geometry, size));
}

// 1280 x 720 becomes 518 x 294, centred in 392 rows below 49 rows of padding.
NetworkGeometry PaddedGeometry() {
  return PadGeometry(MakeNetworkGeometry(ResizePolicy::kCrop, 1280, 720, 518, 0), 518, 392);
}

TEST(IsOnPhoto, TellsPaddingByPixelCentres) {
  EXPECT_FALSE(IsOnPhoto(PaddedGeometry(), {1280, 720}, 0, 48));
  EXPECT_TRUE(IsOnPhoto(PaddedGeometry(), {1280, 720}, 0, 49));
  EXPECT_TRUE(IsOnPhoto(PaddedGeometry(), {1280, 720}, 517, 342));
  EXPECT_FALSE(IsOnPhoto(PaddedGeometry(), {1280, 720}, 517, 343));
}

TEST(ForgetBars, LeavesThePhotoAlone) {
  ViewPrediction prediction;
  prediction.view.camera = MakePinhole(1280, 720, 1000, 1000);
  prediction.view.network_width = 518;
  prediction.view.network_height = 392;
  prediction.view.original_from_network = PaddedGeometry().original_from_network;
  prediction.depth = DepthMap(518, 392, 2.0f);
  prediction.points = Grid<Eigen::Vector3f>(518, 392, Eigen::Vector3f::Ones());
  ForgetBars(prediction);
  for (int y = 0; y < 392; ++y) {
    const bool is_photo = y >= 49 && y < 343;
    EXPECT_EQ(std::isfinite(prediction.depth(100, y)), is_photo) << y;
    EXPECT_EQ(prediction.points(517, y).allFinite(), is_photo) << y;
  }
  EXPECT_TRUE(prediction.depth_conf.empty());
  EXPECT_TRUE(prediction.distractor.empty());
}

}  // namespace
}  // namespace vgtw
