// SPDX-License-Identifier: BSD-3-Clause
#include "matching/sift.h"

#include "matching/sift_budget.h"
#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace vgtw {
namespace {

struct Blob {
  double x = 0.0;  // continuous pixels
  double y = 0.0;
  double sigma = 0.0;
  double height = 150.0;
};

// A bright Gaussian on gray, sampled at the centres of pixels.
GrayImage Draw(int width, int height, const std::vector<Blob>& blobs) {
  GrayImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double value = 60.0;
      for (const Blob& blob : blobs) {
        const double dx = (x + 0.5 - blob.x) / blob.sigma;
        const double dy = (y + 0.5 - blob.y) / blob.sigma;
        value += blob.height * std::exp(-0.5 * (dx * dx + dy * dy));
      }
      image(x, y) = static_cast<uint8_t>(std::lround(std::min(value, 255.0)));
    }
  }
  return image;
}

// Gray squares of random brightness: corners everywhere.
GrayImage Mosaic(int width, int height, int square, uint64_t seed) {
  GrayImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image(x, y) = static_cast<uint8_t>(
          HashKey({seed, static_cast<uint64_t>(x / square), static_cast<uint64_t>(y / square)}) %
          256);
    }
  }
  return image;
}

// Rows whose place is within `radius` pixels.
std::vector<size_t> RowsNear(const Keypoints& keypoints, double x, double y, double radius) {
  std::vector<size_t> rows;
  for (size_t i = 0; i < keypoints.rows; ++i) {
    if (std::hypot(keypoints.x(i) - x, keypoints.y(i) - y) < radius) rows.push_back(i);
  }
  return rows;
}

// A blob of variance t is the strongest in the difference of Gaussians of variances s and k^2 s
// where s = t / k, k = 2^(1/3). SIFT takes the image as already blurred by 0.5, which is in s but
// not done to t.
double ScaleOfBlob(double sigma) { return std::sqrt((sigma * sigma - 0.25) / std::cbrt(2.0)); }

TEST(ExtractSift, FindsBlobsInContinuousPixels) {
  const std::vector<Blob> blobs = {
      {50.0, 40.5, 3.0}, {120.3, 60.8, 4.0}, {200.75, 150.25, 6.0}, {80.1, 160.6, 9.0}};
  const Features features = ExtractSift(Draw(280, 220, blobs), {}, {});
  for (const Blob& blob : blobs) {
    const auto rows = RowsNear(features.keypoints, blob.x, blob.y, 1.0);
    ASSERT_FALSE(rows.empty()) << blob.x;
    for (const size_t row : rows) {
      // A quarter pixel off would be a wrong convention. Bytes and the parabola leave less.
      EXPECT_NEAR(features.keypoints.x(row), blob.x, 0.05);
      EXPECT_NEAR(features.keypoints.y(row), blob.y, 0.05);
      // The parabola through three scales a third of an octave apart.
      EXPECT_NEAR(features.keypoints.Scale(row) / ScaleOfBlob(blob.sigma), 1.0, 0.04);
    }
  }
}

TEST(ExtractSift, ShapesAreScaledRotations) {
  const Features features = ExtractSift(Mosaic(160, 120, 9, 1), {}, {});
  ASSERT_GT(features.keypoints.rows, 100u);
  ASSERT_EQ(features.keypoints.cols, 6u);
  EXPECT_EQ(features.keypoints.data.size(), features.keypoints.rows * 6u);
  for (size_t i = 0; i < features.keypoints.rows; ++i) {
    const float* shape = &features.keypoints.data[i * 6 + 2];
    EXPECT_EQ(shape[0], shape[3]);
    EXPECT_EQ(shape[1], -shape[2]);
  }
}

// A blob on a slope: its own gradients point everywhere, those of the slope one way.
TEST(ExtractSift, OrientationIsThatOfTheGradient) {
  for (const double angle_deg : {0.0, 25.0, 110.0, 200.0, 340.0}) {
    const double angle_rad = angle_deg * std::numbers::pi / 180.0;
    GrayImage image = Draw(100, 100, {{50.3, 49.8, 4.0, 20.0}});
    for (int y = 0; y < 100; ++y) {
      for (int x = 0; x < 100; ++x) {
        const double slope =
            1.2 * ((x - 50) * std::cos(angle_rad) + (y - 50) * std::sin(angle_rad));
        image(x, y) = static_cast<uint8_t>(std::clamp(image(x, y) + slope, 0.0, 255.0));
      }
    }
    const Keypoints keypoints = ExtractSift(image, {}, {}).keypoints;
    const auto rows = RowsNear(keypoints, 50.3, 49.8, 2.0);
    ASSERT_EQ(rows.size(), 1u);
    const float* shape = &keypoints.data[rows[0] * 6 + 2];
    const double found_rad = std::atan2(shape[2], shape[0]);
    // Half a bin of the histogram.
    EXPECT_NEAR(std::remainder(found_rad - angle_rad, 2.0 * std::numbers::pi), 0.0, 0.087);
  }
}

TEST(ExtractSift, DescriptorsHaveLength512) {
  const Features features = ExtractSift(Mosaic(160, 120, 9, 3), {}, {});
  EXPECT_EQ(features.descriptors.type, 0);
  EXPECT_EQ(features.descriptors.cols, 128u);
  EXPECT_EQ(features.descriptors.rows, features.keypoints.rows);
  ASSERT_EQ(features.descriptors.data.size(), features.keypoints.rows * 128u);
  for (size_t i = 0; i < features.descriptors.rows; ++i) {
    double sum = 0.0;
    for (size_t k = 0; k < 128; ++k) sum += std::pow(features.descriptors.data[i * 128 + k], 2);
    // The root of the L1-normalised has length 1; 128 roundings of up to 0.5 and, of few-valued
    // descriptors, the clamp at 255 remain.
    EXPECT_NEAR(std::sqrt(sum), 512.0, 6.0);
  }
}

TEST(ExtractSift, ReducedImagesGiveOriginalPixels) {
  // 500 / 3 and 400 / 3 are not whole: the scale is that of each side.
  const std::vector<Blob> blobs = {{150.4, 130.7, 15.0}, {350.2, 290.9, 24.0}};
  SiftOptions options;
  options.max_image_size = 167;
  const Features features = ExtractSift(Draw(500, 400, blobs), {}, options);
  for (const Blob& blob : blobs) {
    const auto rows = RowsNear(features.keypoints, blob.x, blob.y, 3.0);
    ASSERT_FALSE(rows.empty());
    // 0.08 of a reduced pixel, which is three; half a pixel forgotten would be 1.
    EXPECT_NEAR(features.keypoints.x(rows[0]), blob.x, 0.24);
    EXPECT_NEAR(features.keypoints.y(rows[0]), blob.y, 0.24);
    // Boxes of three pixels add a variance of (9 - 1) / 12, and SIFT again takes 0.5 reduced pixels
    // as done.
    const double sigma = std::sqrt(blob.sigma * blob.sigma + 8.0 / 12.0) / 3.0;
    EXPECT_NEAR(features.keypoints.Scale(rows[0]) / (3.0 * ScaleOfBlob(sigma)), 1.0, 0.04);
  }
}

TEST(ExtractSift, FindsNothingInTheMaskOrItsMargin) {
  const GrayImage image = Mosaic(240, 180, 10, 4);
  StaticMask static_mask(240, 180, 255);
  for (int y = 60; y < 120; ++y) {
    for (int x = 80; x < 160; ++x) static_mask(x, y) = 0;
  }
  SiftOptions options;
  options.mask_margin_scales = 0.0;
  const Keypoints all = ExtractSift(image, {}, options).keypoints;
  const Keypoints outside = ExtractSift(image, static_mask, options).keypoints;
  options.mask_margin_scales = 4.0;
  const Keypoints clear = ExtractSift(image, static_mask, options).keypoints;
  const Grid<float> distance = DistanceToExcluded(static_mask);
  size_t num_outside = 0;
  size_t num_clear = 0;
  for (size_t i = 0; i < all.rows; ++i) {
    if (IsExcluded(static_mask, all.x(i), all.y(i))) continue;
    ++num_outside;
    num_clear +=
        distance(static_cast<int>(all.x(i)), static_cast<int>(all.y(i))) > 4.0f * all.Scale(i);
  }
  EXPECT_LT(num_outside, all.rows);
  EXPECT_LT(num_clear, num_outside);
  // Exactly those: nothing else is lost.
  EXPECT_EQ(outside.rows, num_outside);
  EXPECT_EQ(clear.rows, num_clear);
  EXPECT_EQ(ExtractSift(image, StaticMask(240, 180, 0), options).keypoints.rows, 0u);
}

TEST(ExtractSift, MasksBeforeTheBudget) {
  const GrayImage image = Mosaic(240, 180, 10, 5);
  StaticMask static_mask(240, 180, 255);
  for (int y = 0; y < 180; ++y) {
    for (int x = 0; x < 120; ++x) static_mask(x, y) = 0;
  }
  SiftOptions options;
  options.max_num_features = 60;
  ASSERT_GT(ExtractSift(image, static_mask, {}).keypoints.rows, 60u);
  EXPECT_EQ(ExtractSift(image, static_mask, options).keypoints.rows, 60u);
}

// A quarter of the image has fine, strong texture, the rest coarse and faint.
TEST(ExtractSift, SpreadsTheBudget) {
  GrayImage image = Mosaic(400, 300, 15, 6);
  for (uint8_t& value : image.data()) value = static_cast<uint8_t>(100 + value / 5);
  const GrayImage fine = Mosaic(400, 300, 5, 7);
  for (int y = 0; y < 150; ++y) {
    for (int x = 0; x < 200; ++x) image(x, y) = fine(x, y);
  }
  const auto num_in_corner = [](const Keypoints& keypoints) {
    size_t number = 0;
    for (size_t i = 0; i < keypoints.rows; ++i) {
      number += keypoints.x(i) < 200.0f && keypoints.y(i) < 150.0f;
    }
    return number;
  };
  SiftOptions options;
  const Keypoints all = ExtractSift(image, {}, options).keypoints;
  options.max_num_features = 250;
  ASSERT_GT(all.rows, 800u);
  ASSERT_GT(num_in_corner(all), 250u);  // whose contrast is the highest of all
  const Keypoints spread = ExtractSift(image, {}, options).keypoints;
  EXPECT_EQ(spread.rows, 250u);
  // Its quarter of the cells, and what the other cells cannot give.
  EXPECT_LT(num_in_corner(spread), 250u / 2);
}

TEST(ExtractSift, IsTheSameOnAnyNumberOfThreads) {
  const GrayImage image = Mosaic(400, 300, 8, 8);
  SiftOptions options;
  options.max_num_features = 700;
  const int num_threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const Features one = ExtractSift(image, {}, options);
  cv::setNumThreads(4);
  const Features four = ExtractSift(image, {}, options);
  cv::setNumThreads(num_threads);
  EXPECT_EQ(one.keypoints.rows, 700u);
  EXPECT_EQ(one.keypoints.data, four.keypoints.data);
  EXPECT_EQ(one.descriptors.data, four.descriptors.data);
  for (size_t i = 1; i < one.keypoints.rows; ++i) {
    EXPECT_LE(std::pair(one.keypoints.x(i - 1), one.keypoints.y(i - 1)),
              std::pair(one.keypoints.x(i), one.keypoints.y(i)));
  }
}

TEST(ExtractSift, FindsNothingWhereNothingIs) {
  for (const auto& [width, height] : {std::pair(0, 0), {1, 1}, {3, 200}, {4, 4}, {64, 64}}) {
    const Features features = ExtractSift(GrayImage(width, height, 128), {}, {});
    EXPECT_EQ(features.keypoints.rows, 0u);
    EXPECT_EQ(features.keypoints.cols, 6u);
    EXPECT_EQ(features.descriptors.cols, 128u);
  }
}

TEST(ExtractSift, RefusesOtherMasksAndBadOptions) {
  const GrayImage image(32, 24);
  EXPECT_THROW(ExtractSift(image, StaticMask(24, 32, 255), {}), std::invalid_argument);
  const auto refuses = [&](SiftOptions options) {
    EXPECT_THROW(ExtractSift(image, {}, options), std::invalid_argument);
  };
  refuses({.max_image_size = 0});
  refuses({.max_image_size = 16001});
  refuses({.max_num_features = 0});
  refuses({.peak_threshold = 0.0});
  refuses({.edge_threshold = 1.0});
  refuses({.mask_margin_scales = -1.0});
  refuses({.mask_margin_scales = std::nan("")});
}

TEST(SiftMemory, GrowsWithThePixelsThatAreLookedAt) {
  SiftOptions options;
  options.max_image_size = 1000;
  const int64_t small = SiftMemory({1000, 500}, options);
  EXPECT_EQ(SiftMemory({1000, 1000}, options), 2 * small);
  // Reduced: only the image and the mask grow.
  EXPECT_LT(SiftMemory({2000, 1000}, options), 2 * small);
}

// 16 x 16 cells of 10 pixels.
TEST(SpreadOverImage, TakesTheBestOfEveryCellFirst) {
  const std::vector<ScoredPixel> points = {{{1.0f, 1.0f}, 9.0f},
                                           {{2.0f, 1.0f}, 8.0f},
                                           {{3.0f, 1.0f}, 7.0f},
                                           {{11.0f, 1.0f}, 1.0f},
                                           {{12.0f, 1.0f}, 2.0f},
                                           {{11.0f, 11.0f}, 0.5f}};
  const ImageSize size{160, 160};
  using Idxs = std::vector<size_t>;
  EXPECT_EQ(SpreadOverImage(points, size, 6), (Idxs{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(SpreadOverImage(points, size, 4), (Idxs{0, 1, 4, 5}));
  EXPECT_EQ(SpreadOverImage(points, size, 2), (Idxs{0, 4}));
  EXPECT_EQ(SpreadOverImage(points, size, 0), Idxs{});
}

}  // namespace
}  // namespace vgtw
