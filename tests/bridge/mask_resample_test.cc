// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_resample.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Pixel (x, y) has the value 10 * y + x + 1.
StaticMask Numbered(int width, int height) {
  StaticMask static_mask(width, height, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) static_mask(x, y) = static_cast<uint8_t>(10 * y + x + 1);
  }
  return static_mask;
}

TEST(Resample, TakesTheNearestPixel) {
  const StaticMask twice = Resample(Numbered(2, 1), ScaleMap(0.5, 0.5), {4, 2});
  EXPECT_EQ(twice.data(), (std::vector<uint8_t>{1, 1, 2, 2, 1, 1, 2, 2}));
  // The centre of the upper left pixel of the smaller image falls into column 1 of 3.
  const StaticMask third = Resample(Numbered(6, 3), ScaleMap(3.0, 3.0), {2, 1});
  EXPECT_EQ(third.data(), (std::vector<uint8_t>{12, 15}));
}

TEST(Resample, KeepsWhatTheMaskDoesNotCover) {
  PixelMap shift = IdentityPixelMap();
  shift(0, 2) = 1.0;  // out (0, 0) is mask (1, 0)
  EXPECT_EQ(Resample(Numbered(2, 1), shift, {3, 1}).data(), (std::vector<uint8_t>{2, 255, 255}));
}

TEST(Compose, AppliesTheRightOneFirst) {
  PixelMap shift = IdentityPixelMap();
  shift(0, 2) = 1.0;
  const PixelMap map = Compose(ScaleMap(2.0, 3.0), shift);
  EXPECT_EQ(Apply(map, {1.0, 1.0}), Eigen::Vector2d(4.0, 3.0));
}

TEST(IsScaled, AllowsWholePixelsOnly) {
  EXPECT_TRUE(IsScaled({800, 600}, {1600, 1200}));
  EXPECT_TRUE(IsScaled({518, 388}, {1600, 1200}));  // 388.5 rounded down
  EXPECT_TRUE(IsScaled({518, 389}, {1600, 1200}));
  EXPECT_FALSE(IsScaled({518, 387}, {1600, 1200}));
  EXPECT_FALSE(IsScaled({600, 800}, {1600, 1200}));
}

TEST(Invert, TwiceIsNothing) {
  StaticMask static_mask = Numbered(3, 2);
  Invert(static_mask);
  EXPECT_EQ(static_mask(0, 0), 254);
  Invert(static_mask);
  EXPECT_EQ(static_mask, Numbered(3, 2));
}

}  // namespace
}  // namespace vgtw
