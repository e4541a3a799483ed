// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/contact_sheet.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

ContactSheetRow MakeRow() {
  ContactSheetRow row;
  row.name = "a.jpg";
  row.photo = RgbImage(200, 100, Rgb{60, 90, 120});
  row.static_mask = StaticMask(200, 100, 255);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) row.static_mask(x, y) = 0;
  }
  row.kept_features = {{150.0, 50.0}};
  row.dropped_features = {{50.0, 50.0}};
  return row;
}

// With tiles of 100 px: margins 8, caption 24; the three tiles start at x = 8, 116, 224.
TEST(ContactSheet, ShowsPhotoMaskAndFeaturesSideBySide) {
  const RgbImage sheet = MakeContactSheet({MakeRow()}, /*tile_width=*/100);
  EXPECT_EQ(sheet.width(), 3 * 100 + 4 * 8);
  EXPECT_EQ(sheet.height(), 8 + 24 + 50 + 8);
  const int y = 8 + 24 + 25;
  EXPECT_EQ(sheet(8 + 25, y), (Rgb{60, 90, 120}));
  // Excluded half: one third photo, two thirds red (230, 30, 40).
  EXPECT_EQ(sheet(116 + 25, y), (Rgb{(60 + 460) / 3, (90 + 60) / 3, (120 + 80) / 3}));
  EXPECT_EQ(sheet(116 + 75, y), (Rgb{60, 90, 120}));
  EXPECT_EQ(sheet(224 + 75, y), (Rgb{30, 200, 60}));
  EXPECT_EQ(sheet(224 + 25, y), (Rgb{230, 30, 40}));
  EXPECT_EQ(sheet(224 + 50, y), (Rgb{128 + 30, 128 + 45, 128 + 60}));
}

TEST(ContactSheet, RefusesAMaskOfAnotherSize) {
  ContactSheetRow row = MakeRow();
  row.static_mask = StaticMask(100, 50, 255);
  EXPECT_THROW(MakeContactSheet({row}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
