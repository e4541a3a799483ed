// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_loaders.h"

#include "scene/error.h"

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

TEST(DefaultDust3rMapSize, IsTheSizeThatTheLoaderGives) {
  EXPECT_EQ(DefaultDust3rMapSize({1920, 1080}), (MapSize{512, 288}));
  EXPECT_EQ(DefaultDust3rMapSize({682, 1024}), (MapSize{336, 512}));
  EXPECT_EQ(DefaultDust3rMapSize({1000, 1000}), (MapSize{512, 384}));
  for (const ImageSize& photo : {ImageSize{1000, 667}, {64, 48}, {3, 4}, {999, 1000}}) {
    EXPECT_TRUE(Dust3rGeometry(photo, DefaultDust3rMapSize(photo)));
  }
}

TEST(MapAnythingGeometry, WhatOverhangsIsCutOnBothSides) {
  // 4032x3024 covers 518x392 as floor(522.67) x 392: two columns go on each side.
  const auto wide = MapAnythingGeometry({4032, 3024}, {518, 392});
  ASSERT_TRUE(wide);
  EXPECT_NEAR(wide->original_from_network(0, 0), 4032.0 / 522.0, 1e-12);
  EXPECT_NEAR(wide->original_from_network(0, 2), 2.0 * 4032.0 / 522.0, 1e-12);
  EXPECT_NEAR(wide->original_from_network(1, 1), 3024.0 / 392.0, 1e-12);
  EXPECT_EQ(wide->original_from_network(1, 2), 0.0);
  // 1080x1920 covers 294x518 as 294 x floor(522.67); of three rows too much one goes on top.
  const auto upright = MapAnythingGeometry({1080, 1920}, {294, 519});
  ASSERT_TRUE(upright);
  EXPECT_NEAR(upright->original_from_network(1, 2), 1920.0 / 522.0, 1e-12);
  EXPECT_FALSE(MapAnythingGeometry({1920, 500}, {294, 518}));
  EXPECT_FALSE(MapAnythingGeometry({1, 1000000}, {518, 518}));
}

TEST(ResolvePi3, PhotosAreStretchedToTheFirstOnesAspect) {
  // 255000 pixels at 16:9 are 673.3 x 378.7: 48 x 27 patches.
  const std::vector<Photo> photos = {{"a", {1920, 1080}}, {"b", {600, 600}}};
  const auto geometries = ResolvePi3("p", photos, {672, 378});
  ASSERT_EQ(geometries.size(), 2u);
  EXPECT_TRUE(
      Apply(geometries[1].original_from_network, {672, 378}).isApprox(Eigen::Vector2d(600, 600)));
  EXPECT_THROW(ResolvePi3("p", photos, {378, 672}), Error);
  EXPECT_THROW(ResolvePi3("p", {photos[1], photos[0]}, {672, 378}), Error);
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
