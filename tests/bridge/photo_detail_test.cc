// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/photo_detail.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(PhotoDetail, AnEvenPhotoHasNone) {
  const PhotoDetail detail = MakePhotoDetail(RgbImage(300, 200, {50, 100, 150}));
  EXPECT_EQ(detail.width(), 256);
  EXPECT_EQ(detail.height(), 170);
  for (const float value : detail.data()) EXPECT_NEAR(value, 0.0f, 1e-4f);
}

TEST(PhotoDetail, ASpotStandsOutOfItsNeighbourhood) {
  RgbImage image(64, 64, {0, 0, 0});
  image(40, 20) = {255, 255, 255};
  const PhotoDetail detail = MakePhotoDetail(image);
  ASSERT_EQ(detail.width(), 64);
  // The mean over 17 x 17 pixels holds the spot once.
  EXPECT_NEAR(detail(40, 20), 255.0 - 255.0 / 289, 1e-2);
  EXPECT_NEAR(detail(48, 28), -255.0 / 289, 1e-2);
  EXPECT_NEAR(detail(49, 20), 0.0, 1e-4);
  // At the border the window is cut: 17 x 9 pixels hold the spot in the corner of theirs.
  EXPECT_NEAR(DetailAt(detail, {40.5 / 64, 20.5 / 64}), detail(40, 20), 0.0);
  EXPECT_EQ(DetailAt(detail, {-0.01, 0.5}), 0.0f);
  EXPECT_EQ(DetailAt(detail, {0.5, 1.0}), 0.0f);
}

TEST(Correlation, ByHand) {
  EXPECT_NEAR(Correlation({1, 2, 3}, {10, 20, 30}), 1.0, 1e-12);
  EXPECT_NEAR(Correlation({1, 2, 3}, {3, 2, 1}), -1.0, 1e-12);
  // (-1, 0, 1) . (-2, 1, 1) / (sqrt(2) sqrt(6)) = 3 / sqrt(12).
  EXPECT_NEAR(Correlation({1, 2, 3}, {1, 4, 4}), 0.8660254, 1e-6);
  EXPECT_EQ(Correlation({5, 5, 5}, {1, 2, 3}), 0.0);
  EXPECT_EQ(Correlation({}, {}), 0.0);
  EXPECT_THROW(Correlation({1}, {1, 2}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
