// SPDX-License-Identifier: BSD-3-Clause
#include "scene/exif_orientation.h"

#include "scene/files.h"
#include "tests/scene/exif_jpeg.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

enum class Side { kLeft, kRight, kTop, kBottom };

Side SideOf(const Eigen::Vector2d& pixel, const ImageSize& size) {
  if (pixel.x() == 0.5) return Side::kLeft;
  if (pixel.y() == 0.5) return Side::kTop;
  if (pixel.x() == static_cast<double>(size.width) - 0.5) return Side::kRight;
  EXPECT_EQ(pixel.y(), static_cast<double>(size.height) - 0.5);
  return Side::kBottom;
}

// EXIF 2.3 defines the tag by where the stored 0th row and 0th column are seen.
TEST(UprightFromStored, PutsTheFirstRowAndColumnWhereExifSays) {
  const std::array<std::pair<Side, Side>, 8> row_and_column = {{{Side::kTop, Side::kLeft},
                                                                {Side::kTop, Side::kRight},
                                                                {Side::kBottom, Side::kRight},
                                                                {Side::kBottom, Side::kLeft},
                                                                {Side::kLeft, Side::kTop},
                                                                {Side::kRight, Side::kTop},
                                                                {Side::kRight, Side::kBottom},
                                                                {Side::kLeft, Side::kBottom}}};
  const ImageSize stored = {7, 5};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    const ImageSize upright = UprightSize(orientation, stored);
    EXPECT_EQ(upright, orientation < 5 ? stored : (ImageSize{5, 7})) << orientation;
    const PixelMap map = UprightFromStored(orientation, stored);
    const auto& [row, column] = row_and_column[static_cast<size_t>(orientation - 1)];
    EXPECT_EQ(SideOf(Apply(map, {3.5, 0.5}), upright), row) << orientation;
    EXPECT_EQ(SideOf(Apply(map, {0.5, 2.5}), upright), column) << orientation;
  }
}

TEST(ReadExifOrientation, ReadsTheTagAndTakesTheRestAsUpright) {
  const TemporaryFolder folder;
  WriteImage(folder / "plain.jpg", RgbImage(8, 8));
  WriteImage(folder / "photo.png", RgbImage(8, 8));
  const std::string jpeg = ReadFile(folder / "plain.jpg");
  for (uint32_t orientation = 0; orientation <= 9; ++orientation) {
    WriteFileAtomically(folder / "turned.jpg",
                        InsertExif(jpeg, MakeExif({.orientation = orientation})));
    const bool is_known = orientation >= 1 && orientation <= 8;
    EXPECT_EQ(ReadExifOrientation(folder / "turned.jpg"),
              is_known ? static_cast<int>(orientation) : 1);
  }
  EXPECT_EQ(ReadExifOrientation(folder / "plain.jpg"), 1);
  EXPECT_EQ(ReadExifOrientation(folder / "photo.png"), 1);
  EXPECT_NE(ErrorOf([&] { ReadExifOrientation(folder / "none.jpg"); }), "");
}

TEST(ParseExifOrientation, IsDefinedForDamagedBytes) {
  const std::string exif = MakeExif({.orientation = 6});
  EXPECT_EQ(ParseExifOrientation(AsBytes(exif)), 6);
  for (size_t size = 0; size < exif.size(); ++size) {
    const int orientation = ParseExifOrientation(AsBytes(exif).first(size));
    EXPECT_TRUE(orientation == 1 || orientation == 6) << size;
  }
}

}  // namespace
}  // namespace vgtw
