// SPDX-License-Identifier: BSD-3-Clause
#include "scene/view.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Ratios of sizes, written out: exact to a rounding of numbers of size 4000.
constexpr double kRounding = 1e-11;

void ExpectMaps(const NetworkGeometry& geometry,
                const Eigen::Vector2d& pixel_in_network,
                const Eigen::Vector2d& pixel_in_original) {
  EXPECT_LT((Apply(geometry.original_from_network, pixel_in_network) - pixel_in_original).norm(),
            kRounding)
      << Apply(geometry.original_from_network, pixel_in_network).transpose();
}

TEST(PixelMap, InverseUndoes) {
  PixelMap b_from_a;
  b_from_a << 2.0, 0.5, 10.0, -0.25, 3.0, -7.0;
  const Eigen::Vector2d pixel(12.5, 7.25);
  EXPECT_EQ(Apply(b_from_a, pixel), Eigen::Vector2d(38.625, 11.625));
  EXPECT_LT((Apply(Inverse(b_from_a), Apply(b_from_a, pixel)) - pixel).norm(), kRounding);
  EXPECT_EQ(Apply(IdentityPixelMap(), pixel), pixel);
  EXPECT_THROW(Inverse(PixelMap::Zero()), std::invalid_argument);
}

TEST(NetworkGeometry, CropOfALandscapeKeepsEverything) {
  // 3000 * 518 / 4000 / 14 = 27.75 rounds to 28 patches.
  const auto geometry = MakeNetworkGeometry(ResizePolicy::kCrop, 4000, 3000, 518, 0);
  EXPECT_EQ(geometry.network_width, 518);
  EXPECT_EQ(geometry.network_height, 392);
  ExpectMaps(geometry, {0.0, 0.0}, {0.0, 0.0});
  ExpectMaps(geometry, {0.5, 0.5}, {2000.0 / 518.0, 1500.0 / 392.0});
  ExpectMaps(geometry, {259.0, 196.0}, {2000.0, 1500.0});
  ExpectMaps(geometry, {518.0, 392.0}, {4000.0, 3000.0});
}

TEST(NetworkGeometry, CropOfAPortraitKeepsTheMiddleRows) {
  // 4000 * 518 / 3000 / 14 = 49.33 rounds to 49 patches, 686 rows, of which 84 .. 601 are kept.
  const auto geometry = MakeNetworkGeometry(ResizePolicy::kCrop, 3000, 4000, 518, 0);
  EXPECT_EQ(geometry.network_width, 518);
  EXPECT_EQ(geometry.network_height, 518);
  ExpectMaps(geometry, {0.5, 0.5}, {1500.0 / 518.0, 84.5 * 4000.0 / 686.0});
  ExpectMaps(geometry, {259.0, 259.0}, {1500.0, 2000.0});
  ExpectMaps(geometry, {518.0, 518.0}, {3000.0, 602.0 * 4000.0 / 686.0});
}

TEST(NetworkGeometry, HalvesOfPatchesGoToTheEvenNumber) {
  // 35 / 14 = 2.5 patches become 2, 49 / 14 = 3.5 become 4.
  EXPECT_EQ(MakeNetworkGeometry(ResizePolicy::kCrop, 518, 35, 518, 0).network_height, 28);
  EXPECT_EQ(MakeNetworkGeometry(ResizePolicy::kCrop, 518, 49, 518, 0).network_height, 56);
  EXPECT_EQ(MakeNetworkGeometry(ResizePolicy::kCrop, 518, 34, 518, 0).network_height, 28);
  EXPECT_EQ(MakeNetworkGeometry(ResizePolicy::kCrop, 518, 36, 518, 0).network_height, 42);
}

TEST(NetworkGeometry, PadPutsBarsAroundTheShortSide) {
  // 3000 * 518 / 4000 / 14 = 27.75 rounds to 392; 126 bar pixels, 63 of them first.
  const auto portrait = MakeNetworkGeometry(ResizePolicy::kPad, 3000, 4000, 518, 0);
  EXPECT_EQ(portrait.network_width, 518);
  EXPECT_EQ(portrait.network_height, 518);
  ExpectMaps(portrait, {63.0, 0.0}, {0.0, 0.0});
  ExpectMaps(portrait, {63.5, 0.5}, {1500.0 / 392.0, 2000.0 / 518.0});
  ExpectMaps(portrait, {455.0, 518.0}, {3000.0, 4000.0});
  const auto landscape = MakeNetworkGeometry(ResizePolicy::kPad, 4000, 3000, 518, 0);
  ExpectMaps(landscape, {0.0, 63.0}, {0.0, 0.0});
  ExpectMaps(landscape, {518.0, 455.0}, {4000.0, 3000.0});
  const auto square = MakeNetworkGeometry(ResizePolicy::kPad, 700, 700, 518, 0);
  ExpectMaps(square, {0.0, 0.0}, {0.0, 0.0});
  ExpectMaps(square, {518.0, 518.0}, {700.0, 700.0});
}

TEST(NetworkGeometry, SquarePadCentresTheImageBeforeTheResize) {
  // 640 x 479 on 640 x 640: 161 bar rows, 80 of them first; then 1024 / 640.
  const auto landscape = MakeNetworkGeometry(ResizePolicy::kSquarePad, 640, 479, 1024, 0);
  EXPECT_EQ(landscape.network_width, 1024);
  EXPECT_EQ(landscape.network_height, 1024);
  ExpectMaps(landscape, {0.5, 0.5}, {0.3125, -79.6875});
  ExpectMaps(landscape, {1024.0, 128.0}, {640.0, 0.0});
  const auto portrait = MakeNetworkGeometry(ResizePolicy::kSquarePad, 480, 640, 1024, 0);
  ExpectMaps(portrait, {128.0, 0.0}, {0.0, 0.0});
  ExpectMaps(portrait, {896.0, 1024.0}, {480.0, 640.0});
}

TEST(NetworkGeometry, StretchFillsTheNetworkSize) {
  const auto geometry = MakeNetworkGeometry(ResizePolicy::kStretch, 4000, 3000, 574, 434);
  EXPECT_EQ(geometry.network_width, 574);
  EXPECT_EQ(geometry.network_height, 434);
  ExpectMaps(geometry, {0.5, 0.5}, {2000.0 / 574.0, 1500.0 / 434.0});
  ExpectMaps(geometry, {574.0, 434.0}, {4000.0, 3000.0});
}

TEST(NetworkGeometry, BatchPaddingMovesTheImageByTheFloorOfHalf) {
  const auto geometry = MakeNetworkGeometry(ResizePolicy::kStretch, 100, 200, 50, 50);
  const auto padded = PadGeometry(geometry, 55, 58);
  EXPECT_EQ(padded.network_width, 55);
  EXPECT_EQ(padded.network_height, 58);
  ExpectMaps(padded, {2.0, 4.0}, {0.0, 0.0});
  ExpectMaps(padded, {52.0, 54.0}, {100.0, 200.0});
  EXPECT_THROW(PadGeometry(geometry, 49, 58), std::invalid_argument);
}

TEST(NetworkGeometry, RefusesEmptyAndHairThinImages) {
  EXPECT_THROW(MakeNetworkGeometry(ResizePolicy::kCrop, 0, 10, 518, 0), std::invalid_argument);
  EXPECT_THROW(MakeNetworkGeometry(ResizePolicy::kPad, 10, 0, 518, 0), std::invalid_argument);
  EXPECT_THROW(MakeNetworkGeometry(ResizePolicy::kStretch, 10, 10, 518, 0), std::invalid_argument);
  EXPECT_THROW(MakeNetworkGeometry(ResizePolicy::kSquarePad, 9, 9, 0, 0), std::invalid_argument);
  // 5 rows of 518 are 0.36 of a patch.
  EXPECT_THROW(MakeNetworkGeometry(ResizePolicy::kCrop, 518, 5, 518, 0), std::invalid_argument);
  EXPECT_THROW(MakeNetworkGeometry(ResizePolicy::kCrop, 1, uint64_t{1} << 40, 518, 0),
               std::invalid_argument);
}

View MakeView(ResizePolicy policy) {
  View view;
  view.camera = MakePinhole(3000, 4000, 2800, 2900);
  view.camera.camera_id = 5;
  view.camera.SetPrincipalPoint({1490, 2020});
  const auto geometry = MakeNetworkGeometry(policy, 3000, 4000, 518, 700);
  view.network_width = geometry.network_width;
  view.network_height = geometry.network_height;
  view.original_from_network = geometry.original_from_network;
  return view;
}

TEST(NetworkCamera, ProjectsWhereTheOriginalCameraDoes) {
  for (const ResizePolicy policy : {ResizePolicy::kStretch,
                                    ResizePolicy::kCrop,
                                    ResizePolicy::kPad,
                                    ResizePolicy::kSquarePad}) {
    const View view = MakeView(policy);
    const Camera camera = NetworkCamera(view);
    EXPECT_EQ(FindFault(camera), "");
    EXPECT_EQ(camera.camera_id, 5u);
    EXPECT_EQ(camera.width, static_cast<uint64_t>(view.network_width));
    EXPECT_EQ(camera.height, static_cast<uint64_t>(view.network_height));
    for (int i = 0; i < 10; ++i) {
      const Eigen::Vector3d point = Eigen::Vector3d::Random() + Eigen::Vector3d(0, 0, 3);
      const Eigen::Vector2d pixel_in_network = Project(camera, point).value();
      EXPECT_LT((Apply(view.original_from_network, pixel_in_network) -
                 Project(view.camera, point).value())
                    .norm(),
                kRounding);
    }
  }
}

TEST(NetworkCamera, HasHandComputedIntrinsicsForACroppedPortrait) {
  const Camera camera = NetworkCamera(MakeView(ResizePolicy::kCrop));
  EXPECT_NEAR(camera.FocalLengthX(), 2800.0 * 518.0 / 3000.0, kRounding);
  EXPECT_NEAR(camera.FocalLengthY(), 2900.0 * 686.0 / 4000.0, kRounding);
  EXPECT_NEAR(camera.PrincipalPoint().x(), 1490.0 * 518.0 / 3000.0, kRounding);
  EXPECT_NEAR(camera.PrincipalPoint().y(), 2020.0 * 686.0 / 4000.0 - 84.0, kRounding);
}

TEST(NetworkCamera, RefusesDistortionAndTurnedMaps) {
  View view = MakeView(ResizePolicy::kCrop);
  view.original_from_network(0, 1) = 0.1;
  EXPECT_THROW(NetworkCamera(view), std::invalid_argument);
  view = MakeView(ResizePolicy::kCrop);
  view.original_from_network(0, 0) *= -1.0;
  EXPECT_THROW(NetworkCamera(view), std::invalid_argument);
  view = MakeView(ResizePolicy::kCrop);
  view.camera.model = CameraModel::kSimpleRadial;
  EXPECT_THROW(NetworkCamera(view), std::invalid_argument);
  view = MakeView(ResizePolicy::kCrop);
  view.network_height = 0;
  EXPECT_THROW(NetworkCamera(view), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
