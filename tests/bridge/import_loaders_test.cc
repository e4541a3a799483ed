// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_loaders.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Values worked out by hand from the loaders' rules.

TEST(Dust3rGeometry, PatchesAreCutAroundTheCentre) {
  // 1920x1080 -> 512x288, both multiples of 16: nothing is cut.
  const auto wide = Dust3rGeometry({1920, 1080}, {512, 288});
  ASSERT_TRUE(wide);
  EXPECT_TRUE(Apply(wide->original_from_network, {512, 288}).isApprox(Eigen::Vector2d(1920, 1080)));
  // 854x480 -> 512 x round(287.78) = 288.
  const auto davis = Dust3rGeometry({854, 480}, {512, 288});
  ASSERT_TRUE(davis);
  EXPECT_NEAR(davis->original_from_network(1, 1), 480.0 / 288.0, 1e-12);
  EXPECT_NEAR(davis->original_from_network(0, 0), 854.0 / 512.0, 1e-12);
  // 1000x667 -> 512 x round(341.504) = 342; centre 171, 336 rows from 171 - 168 = 3 on.
  const auto three_to_two = Dust3rGeometry({1000, 667}, {512, 336});
  ASSERT_TRUE(three_to_two);
  EXPECT_NEAR(three_to_two->original_from_network(1, 2), 3.0 * 667.0 / 342.0, 1e-12);
  EXPECT_EQ(three_to_two->original_from_network(0, 2), 0.0);
  // Upright, and an odd side of 341 whose centre is rounded down: 512 x 682 / 1024 = 341.
  const auto upright = Dust3rGeometry({682, 1024}, {336, 512});
  ASSERT_TRUE(upright);
  EXPECT_NEAR(upright->original_from_network(0, 2), 2.0 * 682.0 / 341.0, 1e-12);
}

TEST(Dust3rGeometry, SquaresLoseAQuarterUnlessKeptWhole) {
  const auto cut = Dust3rGeometry({1000, 1000}, {512, 384});
  ASSERT_TRUE(cut);
  EXPECT_NEAR(cut->original_from_network(1, 2), 64.0 * 1000.0 / 512.0, 1e-12);
  const auto whole = Dust3rGeometry({1000, 1000}, {512, 512});
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->original_from_network(1, 2), 0.0);
}

TEST(Dust3rGeometry, SmallModelSeesTheCentralSquare) {
  // Longest side to round(224 * 4 / 3) = 299: 299 x round(224.25) = 224; columns from 149 - 112 on.
  const auto geometry = Dust3rGeometry({640, 480}, {224, 224});
  ASSERT_TRUE(geometry);
  EXPECT_NEAR(geometry->original_from_network(0, 2), 37.0 * 640.0 / 299.0, 1e-12);
  EXPECT_EQ(geometry->original_from_network(1, 2), 0.0);
}

TEST(Dust3rGeometry, OtherSizesAreRefused) {
  EXPECT_FALSE(Dust3rGeometry({1920, 1080}, {518, 294}));
  EXPECT_FALSE(Dust3rGeometry({1080, 1920}, {512, 288}));
  EXPECT_FALSE(Dust3rGeometry({1000000, 1}, {512, 16}));
  EXPECT_FALSE(Dust3rGeometry({1, 1000000}, {2, 2}));
}

TEST(DepthAnything3Geometries, WholePhotosAreStretchedToPatches) {
  // 1920x1080 -> 504 x round(283.5) = 284 -> 280. Here 1080 maps to 280.
  const auto geometries = DepthAnything3Geometries({{1920, 1080}, {1920, 1080}}, {504, 280});
  ASSERT_TRUE(geometries);
  ASSERT_EQ(geometries->size(), 2u);
  EXPECT_TRUE(Apply((*geometries)[1].original_from_network, {504, 280})
                  .isApprox(Eigen::Vector2d(1920, 1080)));
  // Halves go up: 357 = 25.5 * 14.
  const auto half = DepthAnything3Geometries({{504, 357}}, {504, 364});
  ASSERT_TRUE(half);
  EXPECT_NEAR((*half)[0].original_from_network(1, 1), 357.0 / 364.0, 1e-12);
  EXPECT_FALSE(DepthAnything3Geometries({{1920, 1080}}, {504, 504}));
}

TEST(DepthAnything3Geometries, OtherResolutionsAreFound) {
  const auto geometries = DepthAnything3Geometries({{1920, 1080}}, {756, 420});
  ASSERT_TRUE(geometries);
  EXPECT_NEAR((*geometries)[0].original_from_network(0, 0), 1920.0 / 756.0, 1e-12);
}

TEST(DepthAnything3Geometries, MixedBatchesAreCutToTheSmallestSides) {
  // 504x378 and 378x504, both cut to 378x378.
  const auto geometries = DepthAnything3Geometries({{1600, 1200}, {1200, 1600}}, {378, 378});
  ASSERT_TRUE(geometries);
  const PixelMap& wide = (*geometries)[0].original_from_network;
  EXPECT_NEAR(wide(0, 2), 63.0 * 1600.0 / 504.0, 1e-12);
  EXPECT_EQ(wide(1, 2), 0.0);
  const PixelMap& upright = (*geometries)[1].original_from_network;
  EXPECT_EQ(upright(0, 2), 0.0);
  EXPECT_NEAR(upright(1, 2), 63.0 * 1600.0 / 504.0, 1e-12);
}

}  // namespace
}  // namespace vgtw
