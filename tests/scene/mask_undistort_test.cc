// SPDX-License-Identifier: BSD-3-Clause
#include "scene/mask_undistort.h"

#include "tests/scene/sample_cameras.h"

#include <random>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

Camera MakeCamera(CameraModel model, int width, int height, std::vector<double> params) {
  Camera camera;
  camera.model = model;
  camera.width = static_cast<uint64_t>(width);
  camera.height = static_cast<uint64_t>(height);
  camera.params = std::move(params);
  return camera;
}

StaticMask RandomMask(const Camera& camera) {
  std::mt19937 random(7);
  StaticMask mask(static_cast<int>(camera.width), static_cast<int>(camera.height));
  for (uint8_t& value : mask.data()) value = random() % 2 == 0 ? 0 : 255;
  return mask;
}

// Columns from `first` on are kept.
StaticMask KeptFromColumn(int width, int height, int first) {
  StaticMask mask(width, height, 255);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < first; ++x) mask(x, y) = 0;
  }
  return mask;
}

TEST(UndistortMask, EqualCamerasGiveTheMaskBack) {
  for (const Camera& full : SampleCameras()) {
    const Camera camera = Rescale(full, full.width / 4, full.height / 4);
    const StaticMask mask = RandomMask(camera);
    EXPECT_EQ(UndistortMask(mask, camera, camera), mask) << GetCameraModelInfo(camera.model).name;
  }
}

// Column x of twice the focal length is 10 + (x + 0.5 - 10) / 2 = 5.25 + x / 2 of the photo: the
// first to fall into column 7 is x = 4 (7.25).
TEST(UndistortMask, FollowsAZoomByHand) {
  const Camera photo = MakeCamera(CameraModel::kSimplePinhole, 20, 10, {10, 10, 5});
  const Camera zoomed = MakeCamera(CameraModel::kPinhole, 20, 10, {20, 20, 10, 5});
  EXPECT_EQ(UndistortMask(KeptFromColumn(20, 10, 7), photo, zoomed), KeptFromColumn(20, 10, 4));
}

// On the row through the principal point, the ray u = 0.5 of SIMPLE_RADIAL with k = 0.5 is seen at
// 0.5 (1 + 0.5 * 0.25) = 0.5625, that is 56.25 px instead of 50 px off the centre: photo column 156
// holds what column 150 shows undistorted.
TEST(UndistortMask, FollowsARadialDistortionByHand) {
  const Camera photo = MakeCamera(CameraModel::kSimpleRadial, 200, 101, {100, 100.5, 50.5, 0.5});
  const Camera pinhole = MakeCamera(CameraModel::kPinhole, 200, 101, {100, 100, 100.5, 50.5});
  const auto first_kept = [&](int first_column) {
    const StaticMask mask = UndistortMask(KeptFromColumn(200, 101, first_column), photo, pinhole);
    int x = 0;
    while (mask(x, 50) == 0) ++x;
    return x;
  };
  EXPECT_EQ(first_kept(156), 150);
  EXPECT_EQ(first_kept(157), 151);
}

// Half the focal length shows twice the angle: column x is 10 + 2 (x + 0.5 - 10) = 2 x - 9 of the
// photo, whose outermost centres 0.5 and 19.5 leave the columns 5 (1) to 14 (19).
TEST(UndistortMask, ExcludesWhatThePhotoDoesNotShow) {
  const Camera photo = MakeCamera(CameraModel::kPinhole, 20, 1, {10, 10, 10, 0.5});
  const Camera wide = MakeCamera(CameraModel::kPinhole, 20, 1, {5, 10, 10, 0.5});
  const StaticMask mask = UndistortMask(StaticMask(20, 1, 255), photo, wide);
  for (int x = 0; x < 20; ++x) EXPECT_EQ(mask(x, 0), x >= 5 && x <= 14 ? 255 : 0) << x;
}

TEST(UndistortMask, HasTheUndistortedSizeAndRefusesAnotherPhotos) {
  const Camera photo = MakeCamera(CameraModel::kSimpleRadial, 40, 30, {30, 20, 15, -0.1});
  const Camera pinhole = MakeCamera(CameraModel::kPinhole, 17, 23, {30, 30, 8.5, 11.5});
  const StaticMask mask = UndistortMask(StaticMask(40, 30, 255), photo, pinhole);
  EXPECT_EQ(mask, StaticMask(17, 23, 255));
  EXPECT_THROW(UndistortMask(StaticMask(30, 40, 255), photo, pinhole), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
