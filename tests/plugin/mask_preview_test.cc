// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/mask_preview.h"

#include "bridge/mask_files.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

constexpr Rgb kGray = {100, 100, 100};
constexpr Rgb kTinted = {(100 + 235) / 2, 50, (100 + 190) / 2};
constexpr Rgb kWhite = {255, 255, 255};

// Excludes the left half.
StaticMask LeftHalf(int width, int height) {
  StaticMask mask(width, height, 255);
  for (int y = 0; y < height; ++y) std::fill_n(&mask(0, y), width / 2, uint8_t{0});
  return mask;
}

TEST(DrawMaskOverlay, TintsTheExcludedAndDrawsALineWhereItEnds) {
  const RgbImage overlay = DrawMaskOverlay(RgbImage(80, 40, kGray), LeftHalf(80, 40), 40);
  ASSERT_EQ(overlay.width(), 40);
  ASSERT_EQ(overlay.height(), 20);
  for (int y = 0; y < 20; ++y) {
    EXPECT_EQ(overlay(0, y), kTinted) << "the image's border is no line";
    EXPECT_EQ(overlay(18, y), kTinted);
    EXPECT_EQ(overlay(19, y), kWhite);
    EXPECT_EQ(overlay(20, y), kGray);
  }
}

TEST(DrawMaskOverlay, RefusesAMaskOfAnotherSize) {
  EXPECT_THROW(DrawMaskOverlay(RgbImage(80, 40), LeftHalf(40, 20), 40), std::invalid_argument);
}

class WriteMaskPreviewTest : public testing::Test {
 protected:
  // Five photos of two shapes; b.png has no mask.
  void SetUp() override {
    for (const std::string name : {"a.png", "b.png", "c.png", "sub/d.png", "sub/e.png"}) {
      const int height = name == "c.png" ? 80 : 40;
      WriteImage(folder_.path() / "photos" / name, RgbImage(80, height, kGray));
      if (name != "b.png") WriteImage(MaskPath(folder_ / "masks", name), LeftHalf(80, height));
    }
  }
  MaskPreview Run(const MaskPreviewOptions& options) const {
    return WriteMaskPreview(
        folder_ / "photos", folder_ / "masks", folder_ / "preview.png", options);
  }
  const TemporaryFolder folder_;
};

// Margins of 8 px, captions of 24 px: the first photo lies at (8, 32), the second at (56, 32).
TEST_F(WriteMaskPreviewTest, OnePageHoldsAllPhotosInRows) {
  const MaskPreview preview = Run({.num_columns = 3, .tile_width_px = 40});
  ASSERT_EQ(preview.pages.size(), 1u);
  EXPECT_EQ(preview.pages[0], folder_ / "preview.png");
  const RgbImage page = ReadRgbImage(folder_ / "preview.png");
  EXPECT_EQ(page.width(), 3 * 40 + 4 * 8);
  EXPECT_EQ(page.height(), 8 + (24 + 40 + 8) + (24 + 20 + 8));
  EXPECT_EQ(page(8 + 5, 32 + 10), kTinted);
  EXPECT_EQ(page(8 + 30, 32 + 10), kGray);
  EXPECT_EQ(page(56 + 5, 32 + 10), kGray) << "b.png has no mask";
  ASSERT_EQ(preview.images.size(), 5u);
  EXPECT_EQ(preview.images[0].excluded_share, 0.5);
  EXPECT_FALSE(preview.images[1].has_mask);
  EXPECT_EQ(preview.images[4].image_name, "sub/e.png");
}

TEST_F(WriteMaskPreviewTest, MorePagesAreNumbered) {
  const MaskPreview preview = Run({.num_columns = 2, .num_rows = 1, .tile_width_px = 40});
  ASSERT_EQ(preview.pages.size(), 3u);
  EXPECT_EQ(preview.pages[2], folder_ / "preview_3.png");
  // The last page has one photo.
  EXPECT_EQ(ReadRgbImage(preview.pages[2]).width(), 40 + 2 * 8);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "preview.png"));
}

TEST_F(WriteMaskPreviewTest, ReplacesOnlyWhereAsked) {
  Run({});
  EXPECT_THAT(ErrorOf([&] { Run({}); }), HasSubstr("--overwrite"));
  EXPECT_EQ(ErrorOf([&] { Run({.overwrite = true}); }), "");
  WriteImage(folder_ / "masks/a.png.png", LeftHalf(40, 20));
  EXPECT_THAT(ErrorOf([&] { Run({.overwrite = true}); }), HasSubstr("expected 80 x 40"));
  EXPECT_THROW(Run({.num_columns = 0}), std::invalid_argument);
  EXPECT_THROW(Run({.num_columns = 1000, .tile_width_px = 1000}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
