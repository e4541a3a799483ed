// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_undistort_folder.h"

#include "bridge/colmap_model.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

Reconstruction MakeModel(const Camera& camera) {
  Reconstruction model;
  model.cameras[1] = camera;
  model.cameras[1].camera_id = 1;
  for (ImageId id : {1u, 2u}) {
    model.images[id].image_id = id;
    model.images[id].camera_id = 1;
    model.images[id].name = id == 1 ? "a.jpg" : "sub/b.png";
  }
  return model;
}

// The photos see 20 x 10 pixels at a focal length of 10, the undistorted images 20.
class UndistortMasksTest : public testing::Test {
 protected:
  void SetUp() override {
    Camera photo = MakePinhole(20, 10, 10.0, 10.0);
    photo.model = CameraModel::kSimpleRadial;
    photo.params = {10.0, 10.0, 5.0, 0.0};
    WriteModel(MakeModel(photo), folder_ / "sparse");
    WriteModel(MakeModel(MakePinhole(20, 10, 20.0, 20.0)), folder_ / "dense/sparse");
    StaticMask mask(20, 10, 255);
    for (int y = 0; y < 10; ++y) std::fill_n(&mask(0, y), 7, uint8_t{0});
    WriteImage(folder_ / "masks/a.jpg.png", mask);
    WriteImage(folder_ / "masks/sub/b.png.png", StaticMask(20, 10, 255));
  }

  std::vector<MaskSummary> Run(const std::string& undistorted,
                               const UndistortMasksOptions& options = {}) const {
    return UndistortMasks(folder_ / "masks",
                          folder_ / "sparse",
                          undistorted.empty() ? "" : folder_ / undistorted,
                          folder_ / "out",
                          options);
  }
  StaticMask Output(const std::string& name) const {
    return ReadStaticMask(folder_.path() / "out" / name);
  }
  static int FirstKept(const StaticMask& mask) {
    int x = 0;
    while (mask(x, mask.height() / 2) == 0) ++x;
    return x;
  }

  const TemporaryFolder folder_;
};

// Column x shows 5.25 + x / 2 of the photo: from column 4 on it is 7 or more.
TEST_F(UndistortMasksTest, OneMaskPerUndistortedImage) {
  const auto summaries = Run("dense");
  EXPECT_EQ(Snapshot(folder_ / "out").size(), 2u);
  EXPECT_EQ(FirstKept(Output("a.jpg.png")), 4);
  EXPECT_EQ(Output("sub/b.png.png"), StaticMask(20, 10, 255));
  ASSERT_EQ(summaries.size(), 2u);
  EXPECT_EQ(summaries[0].image_name, "a.jpg");
  EXPECT_EQ(summaries[0].excluded_share, 0.2);
}

TEST_F(UndistortMasksTest, TakesTheModelWhereTrainersExpectIt) {
  std::filesystem::create_directories(folder_ / "trainer/sparse");
  std::filesystem::rename(folder_ / "dense/sparse", folder_ / "trainer/sparse/0");
  Run("trainer");
  EXPECT_EQ(FirstKept(Output("a.jpg.png")), 4);
}

// COLMAP 3.8 shrinks images of PINHOLE cameras without their cameras.
TEST_F(UndistortMasksTest, HasTheSizeOfTheImageThatWasWritten) {
  WriteImage(folder_ / "dense/images/a.jpg", RgbImage(10, 5));
  Run("dense");
  EXPECT_EQ(Output("a.jpg.png").width(), 10);
  EXPECT_EQ(FirstKept(Output("a.jpg.png")), 2);
  EXPECT_EQ(Output("sub/b.png.png").width(), 20);
  WriteImage(folder_ / "dense/images/a.jpg", RgbImage(10, 9));
  EXPECT_THAT(ErrorOf([&] { Run("dense", {.overwrite = true}); }),
              HasSubstr("10 x 9 pixels, expected 20 x 10"));
}

TEST_F(UndistortMasksTest, PinholesNeedNoUndistortedImages) {
  EXPECT_THAT(ErrorOf([&] { Run(""); }), HasSubstr("SIMPLE_RADIAL"));
  WriteModel(MakeModel(MakePinhole(20, 10, 10.0, 10.0)), folder_ / "sparse", {.overwrite = true});
  Run("");
  EXPECT_EQ(Snapshot(folder_ / "out"), Snapshot(folder_ / "masks"));
}

TEST_F(UndistortMasksTest, AMissingMaskMustBeAllowed) {
  std::filesystem::remove(folder_ / "masks/sub/b.png.png");
  EXPECT_THAT(ErrorOf([&] { Run("dense"); }), HasSubstr("1 of 2 images have no mask"));
  const auto summaries = Run("dense", {.allow_missing_masks = true});
  EXPECT_FALSE(summaries[0].was_missing);
  EXPECT_TRUE(summaries[1].was_missing);
  EXPECT_EQ(Output("sub/b.png.png"), StaticMask(20, 10, 255));
  std::filesystem::remove_all(folder_ / "masks");
  const UndistortMasksOptions options{.overwrite = true, .allow_missing_masks = true};
  EXPECT_THAT(ErrorOf([&] { Run("dense", options); }), HasSubstr("is not a folder"));
}

TEST_F(UndistortMasksTest, TellsWhatDoesNotFit) {
  EXPECT_THAT(ErrorOf([&] { Run("masks"); }), HasSubstr("image_undistorter"));
  Reconstruction other = MakeModel(MakePinhole(20, 10, 20.0, 20.0));
  other.images[2].name = "c.jpg";
  WriteModel(other, folder_ / "other/sparse");
  EXPECT_THAT(ErrorOf([&] { Run("other"); }), HasSubstr("c.jpg"));
  WriteImage(folder_ / "masks/a.jpg.png", StaticMask(10, 5, 255));
  EXPECT_THAT(ErrorOf([&] { Run("dense"); }), HasSubstr("10 x 5 pixels, expected 20 x 10"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

}  // namespace
}  // namespace vgtw
