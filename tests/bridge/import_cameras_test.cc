// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_cameras.h"

#include "scene/error.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <limits>

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

TEST(IsResized, AllowsOnePixelOfRounding) {
  EXPECT_TRUE(IsResized({2016, 1512}, {1600, 1200}));
  EXPECT_TRUE(IsResized({4032, 3024}, {706, 529}));
  EXPECT_FALSE(IsResized({4032, 3024}, {3024, 4032}));
  EXPECT_FALSE(IsResized({1600, 1200}, {1600, 1190}));
  EXPECT_FALSE(IsResized({0, 0}, {1600, 1190}));
}

TEST(CameraSource, TakesGivenParameters) {
  const std::vector<Photo> photos = {{"a.png", {640, 480}}};
  EXPECT_EQ(CameraSource("", photos, "500").Make(photos[0]).params, (Params{500, 500, 320, 240}));
  EXPECT_EQ(CameraSource("", photos, "500, 501,322,239.5").Make(photos[0]).params,
            (Params{500, 501, 322, 239.5}));
  for (const char* text :
       {"f", "", "500,501", "500,501,320", "-5", "0", "1e400", "500,,3,4", "5 0"}) {
    if (*text == '\0') continue;
    EXPECT_THROW(CameraSource("", photos, text), Error) << text;
  }
  const std::vector<Photo> two_sizes = {{"a.png", {640, 480}}, {"b.png", {800, 600}}};
  EXPECT_THROW(CameraSource("", two_sizes, "500,500,320,240"), Error);
  EXPECT_EQ(CameraSource("", two_sizes, "500").Make(two_sizes[1]).params,
            (Params{500, 500, 400, 300}));
}

TEST(CameraSource, GuessesWithAWarningWhereNothingIsKnown) {
  const TemporaryFolder folder;
  WritePhotos(folder.path(), {"a.png"}, 64, 80);
  const std::vector<Photo> photos = ListPhotos(folder.path(), 1);
  CameraSource cameras(folder.path(), photos, "");
  EXPECT_EQ(cameras.Warning(), "");
  const Camera camera = cameras.Make(photos[0]);
  EXPECT_EQ(camera.params, (Params{1.2 * 80, 1.2 * 80, 32, 40}));
  EXPECT_FALSE(camera.has_prior_focal_length);
  EXPECT_NE(cameras.Warning().find("1 of 1 photos"), std::string::npos);
  EXPECT_NE(cameras.Warning().find("--camera_params"), std::string::npos);
}

}  // namespace
}  // namespace vgtw
