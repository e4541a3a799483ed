// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/probe_sheet.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A gray photo of 80 x 40, of which the network saw 2 x 1 patches of 40 px, tiles half as wide: the
// query at (60, 10), tiles from x = 8 and 56, pictures from y = 32.
TEST(ProbeSheet, ShowsTheQueryAndTheMapsInTheirColours) {
  ProbePhoto photo = {"a.png", RgbImage(80, 40, Rgb{100, 100, 100}), IdentityPixelMap()};
  photo.original_from_patch.leftCols<2>() *= 40.0;
  std::vector<Grid<float>> maps = {Grid<float>(2, 1, 0.5f)};
  maps[0](1, 0) = 2.5f;
  const RgbImage sheet = MakeProbeSheet(
      {photo}, {0, {60.0, 10.0}}, {{{"map"}, &maps, {0.5f, 2.5f}}}, /*tile_width=*/40);
  EXPECT_EQ(sheet(8 + 30, 32 + 5), (Rgb{230, 30, 40}));
  EXPECT_EQ(sheet(8 + 10, 32 + 5), (Rgb{100, 100, 100}));
  // A quarter gray, three quarters the first or last colour of the ramp.
  EXPECT_EQ(sheet(56 + 10, 32 + 5), (Rgb{(100 + 30) / 4, (100 + 30) / 4, (100 + 210) / 4}));
  EXPECT_EQ(sheet(56 + 30, 32 + 5), (Rgb{(100 + 765) / 4, (100 + 750) / 4, (100 + 450) / 4}));
}

TEST(ProbeSheet, TheRangeIgnoresAPeak) {
  Grid<float> map(100, 10, 0.0f);
  for (size_t i = 0; i < map.size(); ++i) map.data()[i] = static_cast<float>(i) / 999.0f;
  map.data().back() = 100.0f;
  const auto [low, high] = RangeOf({map});
  EXPECT_EQ(low, 0.0f);
  EXPECT_NEAR(high, 0.995f, 1e-4f);
}

}  // namespace
}  // namespace vgtw
