// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_cameras.h"

#include "scene/error.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Params = std::vector<double>;

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
