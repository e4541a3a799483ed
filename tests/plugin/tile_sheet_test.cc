// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/tile_sheet.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr Rgb kRed = {200, 0, 0};
constexpr Rgb kBlue = {0, 0, 200};
constexpr Rgb kWhite = {255, 255, 255};

// Margins of 8 px, captions of 24 px.
TEST(TileSheet, PutsPicturesInRows) {
  const RgbImage sheet =
      MakeTileSheet({{{"", RgbImage(30, 20, kRed)}, {"", RgbImage(10, 5, kBlue)}},
                     {{"", RgbImage(10, 10, kBlue)}}});
  EXPECT_EQ(sheet.width(), 8 + 30 + 8 + 10 + 8);
  EXPECT_EQ(sheet.height(), 8 + (24 + 20 + 8) + (24 + 10 + 8));
  EXPECT_EQ(sheet(8, 32), kRed);
  EXPECT_EQ(sheet(37, 51), kRed);
  EXPECT_EQ(sheet(38, 51), kWhite);
  EXPECT_EQ(sheet(46, 32), kBlue);
  EXPECT_EQ(sheet(46, 37), kWhite);
  EXPECT_EQ(sheet(8, 84), kBlue);
}

TEST(TileSheet, ACaptionEndsWithItsPicture) {
  const std::string caption(100, 'M');
  const RgbImage sheet = MakeTileSheet({{{caption, RgbImage(40, 5)}, {"", RgbImage(40, 5)}}});
  bool has_ink = false;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < sheet.width(); ++x) {
      const bool is_ink = sheet(x, y) != kWhite;
      EXPECT_FALSE(is_ink && x >= 48);
      has_ink = has_ink || is_ink;
    }
  }
  EXPECT_TRUE(has_ink);
}

TEST(TileSheet, RefusesAnEmptyPicture) {
  EXPECT_THROW(MakeTileSheet({{{"a", RgbImage()}}}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
