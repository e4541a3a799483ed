// SPDX-License-Identifier: BSD-3-Clause
#include "matching/descriptor_distance.h"

#include "scene/random.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Descriptors Bytes(uint32_t rows, std::vector<uint8_t> data, int type = 0) {
  const auto cols = static_cast<uint32_t>(data.size() / rows);
  return {rows, cols, type, std::move(data)};
}

Descriptors Floats(uint32_t rows, const std::vector<float>& values, int type = 1) {
  std::vector<uint8_t> data(values.size() * sizeof(float));
  std::memcpy(data.data(), values.data(), data.size());
  return Bytes(rows, std::move(data), type);
}

Descriptors RandomBytes(uint32_t rows, uint32_t cols, uint64_t seed) {
  RandomStream random(seed);
  std::vector<uint8_t> data(size_t{rows} * cols);
  for (uint8_t& value : data) value = static_cast<uint8_t>(random.Bits() >> 56);
  return {rows, cols, 0, std::move(data)};
}

TEST(DescriptorDistance, OfBytesByHand) {
  const Descriptors a = Bytes(2, {0, 10, 255, 1, 2, 3});
  const Descriptors b = Bytes(2, {3, 6, 255, 255, 0, 3});
  const DescriptorDistance distance(a, b);
  EXPECT_EQ(distance(0, 0), 9.0f + 16.0f);
  EXPECT_EQ(distance(0, 1), 65025.0f + 100.0f + 63504.0f);
  EXPECT_EQ(distance(1, 0), 4.0f + 16.0f + 63504.0f);
  EXPECT_EQ(distance(1, 1), 64516.0f + 4.0f);
}

TEST(DescriptorDistance, OfFloatsByHand) {
  const Descriptors a = Floats(1, {0.5f, -2.0f, 0.25f});
  const Descriptors b = Floats(2, {-0.5f, 1.0f, 0.25f, 0.5f, -2.0f, 0.25f});
  EXPECT_EQ(DescriptorDistance(a, b)(0, 0), 10.0f);
  EXPECT_EQ(DescriptorDistance(a, b)(0, 1), 0.0f);
}

// The same bytes mean other numbers: 1.0f is 00 00 80 3f.
TEST(DescriptorDistance, TypeTellsBytesFromFloats) {
  for (const int type : {-1, 0, 1, 2}) {
    const Descriptors one = Floats(1, {1.0f}, type);
    const Descriptors zero = Floats(1, {0.0f}, type);
    EXPECT_EQ(DescriptorDistance(one, zero)(0, 0),
              type > 0 ? 1.0f : 128.0f * 128.0f + 63.0f * 63.0f);
  }
  // An undefined type is bytes too.
  EXPECT_EQ(DescriptorDistance(Bytes(1, {1, 2}, -1), Bytes(1, {2, 4}, 0))(0, 0), 5.0f);
}

TEST(DescriptorDistance, EqualsThePlainLoopForAnyLength) {
  for (const uint32_t cols : {1u, 2u, 7u, 16u, 31u, 64u, 127u, 128u, 129u, 256u, 1024u}) {
    const Descriptors a = RandomBytes(9, cols, cols);
    const Descriptors b = RandomBytes(13, cols, 1000 + cols);
    const DescriptorDistance distance(a, b);
    for (size_t i = 0; i < 9; ++i) {
      for (size_t j = 0; j < 13; ++j) {
        int64_t sum = 0;
        for (size_t k = 0; k < cols; ++k) {
          const int64_t difference = int64_t{a.data[i * cols + k]} - b.data[j * cols + k];
          sum += difference * difference;
        }
        ASSERT_EQ(distance(i, j), static_cast<float>(sum)) << cols;
      }
    }
  }
}

// 33026 squares of 255 are more than an int holds.
TEST(DescriptorDistance, LongestBytesDoNotOverflow) {
  const uint32_t cols = 33000;
  const Descriptors black = Bytes(1, std::vector<uint8_t>(cols, 0));
  const Descriptors white = Bytes(1, std::vector<uint8_t>(cols, 255));
  EXPECT_EQ(DescriptorDistance(black, white)(0, 0), 65025.0f * 33000.0f);
  const Descriptors longer = Bytes(1, std::vector<uint8_t>(33026, 255));
  EXPECT_THROW(DescriptorDistance(longer, longer), std::invalid_argument);
}

TEST(DescriptorDistance, OfOddNumbersOfFloats) {
  const std::vector<float> values = {1.0f, 2.0f, 3.0f, 4.0f, 6.0f, 8.0f, 0.0f, 0.0f, 1e-3f};
  const Descriptors a = Floats(3, values, 2);
  const DescriptorDistance distance(a, a);
  EXPECT_EQ(distance(0, 1), 9.0f + 16.0f + 25.0f);
  EXPECT_EQ(distance(2, 0), 1.0f + 4.0f + (1e-3f - 3.0f) * (1e-3f - 3.0f));
}

TEST(DescriptorDistance, NaNIsNearToNothing) {
  const Descriptors nan = Floats(1, {std::nanf(""), 0.0f});
  const Descriptors zero = Floats(1, {0.0f, 0.0f});
  EXPECT_FALSE(DescriptorDistance(nan, zero)(0, 0) < kInfinity);
  EXPECT_FALSE(DescriptorDistance(nan, nan)(0, 0) < kInfinity);
}

TEST(DescriptorDistance, RefusesOtherKinds) {
  const Descriptors bytes = Bytes(1, std::vector<uint8_t>(8));
  EXPECT_THROW(DescriptorDistance(bytes, Bytes(1, std::vector<uint8_t>(4))), std::invalid_argument);
  EXPECT_THROW(DescriptorDistance(bytes, Floats(1, {0.0f, 0.0f})), std::invalid_argument);
  // ALIKED of 16 and of 32 points: other networks, whose numbers mean nothing to each other.
  EXPECT_THROW(DescriptorDistance(Floats(1, {0.0f}, 1), Floats(1, {0.0f}, 2)),
               std::invalid_argument);
  EXPECT_THROW(DescriptorDistance(Bytes(1, {0, 0, 0, 0, 0, 0}, 1), Bytes(1, {0, 0, 0, 0, 0, 0}, 1)),
               std::invalid_argument);
  Descriptors cut_off = bytes;
  cut_off.data.pop_back();
  EXPECT_THROW(DescriptorDistance(cut_off, bytes), std::invalid_argument);
  EXPECT_THROW(DescriptorDistance(bytes, cut_off), std::invalid_argument);
}

TEST(DescriptorDistance, AnEmptySetGoesWithEveryOther) {
  const Descriptors empty;
  EXPECT_NO_THROW(DescriptorDistance(empty, empty));
  EXPECT_NO_THROW(DescriptorDistance(empty, Floats(1, {0.0f})));
  EXPECT_NO_THROW(DescriptorDistance(Bytes(1, {1, 2, 3}), empty));
  // Of another kind, but of no rows.
  EXPECT_NO_THROW(DescriptorDistance(Bytes(1, {1, 2, 3}), Descriptors{0, 128, 1, {}}));
}

TEST(BackgroundDistances, ByHand) {
  // One byte each, in a row 10 px apart; every one is a sample.
  const Descriptors descriptors = Bytes(4, {0, 3, 10, 4});
  const std::vector<Eigen::Vector2f> pixels = {{0, 0}, {10, 0}, {20, 0}, {30, 0}};
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 4, 5.0f),
            (std::vector<float>{9.0f, 1.0f, 36.0f, 1.0f}));
  // What is nearer than 15 px is the feature's own texture.
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 4, 15.0f),
            (std::vector<float>{16.0f, 1.0f, 100.0f, 1.0f}));
  // Exactly at the distance counts.
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 4, 10.0f),
            (std::vector<float>{9.0f, 1.0f, 36.0f, 1.0f}));
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 4, 30.0f),
            (std::vector<float>{16.0f, kInfinity, kInfinity, 16.0f}));
}

// Two samples of four: the second and the last, which stand for their halves.
TEST(BackgroundDistances, OnlySamplesCount) {
  const Descriptors descriptors = Bytes(4, {0, 3, 10, 4});
  const std::vector<Eigen::Vector2f> pixels = {{0, 0}, {10, 0}, {20, 0}, {30, 0}};
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 2, 5.0f),
            (std::vector<float>{9.0f, 1.0f, 36.0f, 1.0f}));
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 1, 5.0f),
            (std::vector<float>{100.0f, 49.0f, kInfinity, 36.0f}));
  // None asked for is as one.
  EXPECT_EQ(BackgroundDistances(descriptors, pixels, 0, 5.0f),
            BackgroundDistances(descriptors, pixels, 1, 5.0f));
}

TEST(BackgroundDistances, EqualTheNearestOfAllIfAllAreSamples) {
  RandomStream random(5);
  const Descriptors descriptors = RandomBytes(60, 128, 3);
  std::vector<Eigen::Vector2f> pixels;
  for (int i = 0; i < 60; ++i) {
    const double x = random.Uniform(0.0, 100.0);
    pixels.emplace_back(x, random.Uniform(0.0, 100.0));
  }
  const DescriptorDistance distance(descriptors, descriptors);
  const std::vector<float> background = BackgroundDistances(descriptors, pixels, 1000, 20.0f);
  for (size_t i = 0; i < 60; ++i) {
    float nearest = kInfinity;
    for (size_t j = 0; j < 60; ++j) {
      if ((pixels[i] - pixels[j]).norm() >= 20.0f) nearest = std::min(nearest, distance(i, j));
    }
    EXPECT_EQ(background[i], nearest);
  }
}

TEST(BackgroundDistances, NoFeaturesOrNaNDoNoHarm) {
  EXPECT_TRUE(BackgroundDistances({}, {}, 256, 5.0f).empty());
  const Descriptors descriptors = Floats(3, {0.0f, std::nanf(""), 2.0f});
  EXPECT_EQ(BackgroundDistances(descriptors, {{0, 0}, {10, 0}, {20, 0}}, 3, 5.0f),
            (std::vector<float>{4.0f, kInfinity, 4.0f}));
  EXPECT_THROW(BackgroundDistances(descriptors, {{0, 0}}, 3, 5.0f), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
