// SPDX-License-Identifier: BSD-3-Clause
#include "scene/drawing.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr Rgb kBlack = {0, 0, 0};
constexpr Rgb kRed = {255, 0, 0};

TEST(Drawing, HalvingAveragesFourPixels) {
  RgbImage image(4, 2, kBlack);
  image(0, 0) = {100, 0, 40};
  image(1, 1) = {100, 80, 0};
  const RgbImage half = ResizeImage(image, 2, 1);
  EXPECT_EQ(half(0, 0), (Rgb{50, 20, 10}));
  EXPECT_EQ(half(1, 0), kBlack);
}

TEST(Drawing, DiscIsCentredOnContinuousPixels) {
  RgbImage image(9, 9, kBlack);
  DrawDisc({4.5, 4.5}, 2.0, kRed, image);
  EXPECT_EQ(image(4, 4), kRed);
  // Symmetric around the centre of pixel (4, 4), but for the rounding of OpenCV's anti-aliasing.
  for (int d = 1; d <= 4; ++d) {
    EXPECT_NEAR(image(4 - d, 4)[0], image(4 + d, 4)[0], 4) << d;
    EXPECT_NEAR(image(4, 4 - d)[0], image(4, 4 + d)[0], 4) << d;
  }
  EXPECT_EQ(image(4 + 4, 4), kBlack);
  DrawDisc({-50.0, 3.0}, 2.0, kRed, image);
}

TEST(Drawing, TextStandsOnItsBaseline) {
  RgbImage image(60, 30, kBlack);
  DrawText("H", 5, 25, 14.0, kRed, image);
  int top = 30;
  int bottom = -1;
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 60; ++x) {
      if (image(x, y)[0] < 128) continue;
      top = std::min(top, y);
      bottom = std::max(bottom, y);
    }
  }
  EXPECT_NEAR(bottom, 25, 1);
  EXPECT_NEAR(bottom - top, 14, 2);
}

TEST(Drawing, PasteCopiesAndRefusesWhatDoesNotFit) {
  RgbImage canvas(4, 4, kBlack);
  Paste(RgbImage(2, 2, kRed), 2, 1, canvas);
  EXPECT_EQ(canvas(2, 1), kRed);
  EXPECT_EQ(canvas(3, 2), kRed);
  EXPECT_EQ(canvas(1, 1), kBlack);
  EXPECT_THROW(Paste(RgbImage(2, 2, kRed), 3, 0, canvas), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
