// SPDX-License-Identifier: BSD-3-Clause
#include "matching/feature_grid.h"

#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

std::vector<uint32_t> Visited(const FeatureGrid& grid, const Capsule& capsule) {
  std::vector<uint32_t> idxs;
  grid.ForEachIn(capsule, [&](uint32_t idx) { idxs.push_back(idx); });
  std::sort(idxs.begin(), idxs.end());
  return idxs;
}

// Distance from the axis in double, by the definition.
double Distance(const Capsule& capsule, const Eigen::Vector2f& pixel) {
  const Eigen::Vector2d start = capsule.start.cast<double>();
  const Eigen::Vector2d axis = capsule.end.cast<double>() - start;
  const Eigen::Vector2d offset = pixel.cast<double>() - start;
  const double length2 = axis.squaredNorm();
  const double along = length2 > 0.0 ? std::clamp(offset.dot(axis) / length2, 0.0, 1.0) : 0.0;
  return (offset - along * axis).norm();
}

std::vector<Eigen::Vector2f> RandomPixels(size_t count, float width, float height, uint64_t seed) {
  RandomStream random(seed);
  std::vector<Eigen::Vector2f> pixels;
  for (size_t i = 0; i < count; ++i) {
    // A tenth beyond the rims.
    const double x = random.Uniform(-0.05, 1.05);
    pixels.emplace_back(x * width, random.Uniform(-0.05, 1.05) * height);
  }
  return pixels;
}

Eigen::Vector2f RandomPlace(RandomStream& random, double width, double height, double reach) {
  const double x = random.Uniform(-reach, 1.0 + reach) * width;
  return {static_cast<float>(x), static_cast<float>(random.Uniform(-reach, 1.0 + reach) * height)};
}

// Capsules of every sort: points, horizontal, vertical, any, at the rims, far away.
Capsule RandomCapsule(RandomStream& random, double width, double height, double reach) {
  Capsule capsule;
  capsule.start = RandomPlace(random, width, height, reach);
  capsule.end = RandomPlace(random, width, height, reach);
  switch (random.Bits() % 6) {
    case 0:
      capsule.end = capsule.start;
      break;
    case 1:
      capsule.end.y() = capsule.start.y();
      break;
    case 2:
      capsule.end.x() = capsule.start.x();
      break;
    case 3:  // nearly horizontal
      capsule.end.y() = std::nextafter(capsule.start.y(), kInfinity);
      break;
    default:
      break;
  }
  capsule.radius = static_cast<float>(std::exp(random.Uniform(-3.0, 6.0)));
  return capsule;
}

// What floats lose: a few times the last bit of the largest coordinate.
void ExpectEqualToBruteForce(const std::vector<Eigen::Vector2f>& pixels,
                             const FeatureGrid& grid,
                             const Capsule& capsule) {
  const double largest = std::max({1e3,
                                   std::abs(double{capsule.start.x()}),
                                   std::abs(double{capsule.start.y()}),
                                   std::abs(double{capsule.end.x()}),
                                   std::abs(double{capsule.end.y()})});
  const double rim = 1e-6 * largest;
  const std::vector<uint32_t> visited = Visited(grid, capsule);
  ASSERT_EQ(std::adjacent_find(visited.begin(), visited.end()), visited.end()) << "visited twice";
  for (uint32_t i = 0; i < pixels.size(); ++i) {
    const double distance = Distance(capsule, pixels[i]);
    if (std::abs(distance - capsule.radius) <= rim) continue;
    ASSERT_EQ(std::binary_search(visited.begin(), visited.end(), i), distance < capsule.radius)
        << "pixel " << pixels[i].transpose() << " capsule " << capsule.start.transpose() << " to "
        << capsule.end.transpose() << " radius " << capsule.radius << " distance " << distance;
  }
}

TEST(Capsule, DistanceByHand) {
  const Capsule capsule = {{1.0f, 1.0f}, {5.0f, 4.0f}, 1.0f};
  EXPECT_EQ(capsule.SquaredDistanceToAxis({1.0f, 1.0f}), 0.0f);
  EXPECT_EQ(capsule.SquaredDistanceToAxis({-2.0f, -3.0f}), 25.0f);  // behind the start
  EXPECT_EQ(capsule.SquaredDistanceToAxis({8.0f, 8.0f}), 25.0f);    // behind the end
  // The axis is a 3-4-5 triangle's; (3, 2.5) is its middle and (-3, 4) / 5 its normal.
  EXPECT_NEAR(capsule.SquaredDistanceToAxis({3.0f - 6.0f, 2.5f + 8.0f}), 100.0f, 1e-4);
  const Capsule point = {{2.0f, 3.0f}, {2.0f, 3.0f}, 1.0f};
  EXPECT_EQ(point.SquaredDistanceToAxis({5.0f, 7.0f}), 25.0f);
}

TEST(FeatureGrid, EqualsBruteForce) {
  RandomStream random(1);
  for (const Eigen::Vector2f& size : {Eigen::Vector2f(640.0f, 480.0f),
                                      Eigen::Vector2f(33.0f, 4000.0f),
                                      Eigen::Vector2f(5000.0f, 7.0f)}) {
    const auto pixels = RandomPixels(400, size.x(), size.y(), 2);
    const FeatureGrid grid(pixels, size.x(), size.y());
    for (int i = 0; i < 1500; ++i) {
      ASSERT_NO_FATAL_FAILURE(
          ExpectEqualToBruteForce(pixels, grid, RandomCapsule(random, size.x(), size.y(), 0.3)));
    }
  }
}

// Segments of wide depth ranges end far outside of the image.
TEST(FeatureGrid, EqualsBruteForceForFarCapsules) {
  RandomStream random(3);
  const auto pixels = RandomPixels(400, 640.0f, 480.0f, 4);
  const FeatureGrid grid(pixels, 640.0f, 480.0f);
  for (const double reach : {10.0, 300.0, 1e4}) {
    for (int i = 0; i < 1000; ++i) {
      ASSERT_NO_FATAL_FAILURE(
          ExpectEqualToBruteForce(pixels, grid, RandomCapsule(random, 640.0, 480.0, reach)));
    }
  }
}

// Cells end where pixels lie, and capsules end at pixels.
TEST(FeatureGrid, EqualsBruteForceOnALattice) {
  std::vector<Eigen::Vector2f> pixels;
  for (int y = 0; y <= 16; ++y) {
    for (int x = 0; x <= 16; ++x) pixels.emplace_back(x, y);
  }
  const FeatureGrid grid(pixels, 16.0f, 16.0f);
  RandomStream random(5);
  for (int i = 0; i < 3000; ++i) {
    const auto whole = [&] { return static_cast<float>(random.Bits() % 21) - 2.0f; };
    Capsule capsule;
    capsule.start.x() = whole();
    capsule.start.y() = whole();
    capsule.end.x() = i % 2 == 0 ? capsule.start.x() : whole();
    capsule.end.y() = i % 3 == 0 ? capsule.start.y() : whole();
    capsule.radius = 0.5f * static_cast<float>(random.Bits() % 9);
    const std::vector<uint32_t> visited = Visited(grid, capsule);
    for (uint32_t k = 0; k < pixels.size(); ++k) {
      // Many lie on the rim exactly, as Capsule sees it.
      const float distance2 = capsule.SquaredDistanceToAxis(pixels[k]);
      ASSERT_EQ(std::binary_search(visited.begin(), visited.end(), k),
                distance2 <= capsule.radius * capsule.radius)
          << pixels[k].transpose() << " in " << capsule.start.transpose() << " to "
          << capsule.end.transpose() << " radius " << capsule.radius;
    }
  }
}

TEST(FeatureGrid, FindsPixelsOutsideOfTheImage) {
  const std::vector<Eigen::Vector2f> pixels = {
      {-50.0f, -70.0f}, {900.0f, 20.0f}, {30.0f, 1e6f}, {10.0f, 10.0f}};
  const FeatureGrid grid(pixels, 100.0f, 80.0f);
  for (uint32_t i = 0; i < pixels.size(); ++i) {
    EXPECT_EQ(Visited(grid, {pixels[i], pixels[i], 1.0f}), std::vector<uint32_t>{i});
  }
  EXPECT_EQ(Visited(grid, {{-60.0f, -70.0f}, {1000.0f, -70.0f}, 15.0f}), std::vector<uint32_t>{0});
}

TEST(FeatureGrid, NaNIsNowhere) {
  const std::vector<Eigen::Vector2f> pixels = {{kNaN, 5.0f},
                                               {5.0f, kNaN},
                                               {kNaN, kNaN},
                                               {5.0f, 5.0f},
                                               {kInfinity, 5.0f},
                                               {5.0f, -kInfinity}};
  const FeatureGrid grid(pixels, 10.0f, 10.0f);
  EXPECT_EQ(Visited(grid, {{0.0f, 0.0f}, {10.0f, 10.0f}, 1e6f}), std::vector<uint32_t>{3});
  EXPECT_TRUE(Visited(grid, {{kNaN, 0.0f}, {10.0f, 10.0f}, 5.0f}).empty());
  EXPECT_TRUE(Visited(grid, {{0.0f, 0.0f}, {10.0f, 10.0f}, kNaN}).empty());
  EXPECT_TRUE(Visited(grid, {{kInfinity, 0.0f}, {kInfinity, 10.0f}, 5.0f}).empty());
}

TEST(FeatureGrid, NoneOneAndManyInOnePlace) {
  const Capsule all = {{0.0f, 0.0f}, {64.0f, 48.0f}, 100.0f};
  const std::vector<Eigen::Vector2f> none;
  EXPECT_TRUE(Visited(FeatureGrid(none, 64.0f, 48.0f), all).empty());
  const std::vector<Eigen::Vector2f> one = {{3.0f, 4.0f}};
  EXPECT_EQ(Visited(FeatureGrid(one, 64.0f, 48.0f), all), std::vector<uint32_t>{0});
  // On the rim, and just beyond it.
  EXPECT_EQ(Visited(FeatureGrid(one, 64.0f, 48.0f), {{0, 0}, {0, 0}, 5.0f}).size(), 1u);
  EXPECT_EQ(Visited(FeatureGrid(one, 64.0f, 48.0f), {{0, 0}, {0, 0}, 4.999f}).size(), 0u);
  const std::vector<Eigen::Vector2f> same(5000, Eigen::Vector2f(63.9f, 47.9f));
  EXPECT_EQ(Visited(FeatureGrid(same, 64.0f, 48.0f), all).size(), 5000u);
}

TEST(FeatureGrid, RadiusZeroHoldsTheAxisOnly) {
  const std::vector<Eigen::Vector2f> pixels = {{5.0f, 5.0f}, {5.0f, 5.5f}};
  const FeatureGrid grid(pixels, 10.0f, 10.0f);
  EXPECT_EQ(Visited(grid, {{0.0f, 5.0f}, {9.0f, 5.0f}, 0.0f}), std::vector<uint32_t>{0});
}

// The order depends on the grid alone: an ambiguous search gives the same on every call.
TEST(FeatureGrid, OrderIsTheSameForEveryCapsule) {
  const auto pixels = RandomPixels(300, 100.0f, 100.0f, 7);
  const FeatureGrid grid(pixels, 100.0f, 100.0f);
  std::vector<uint32_t> order;
  grid.ForEachIn({{0, 0}, {100, 100}, 500.0f}, [&](uint32_t idx) { order.push_back(idx); });
  ASSERT_EQ(order.size(), pixels.size());
  std::vector<size_t> rank(order.size());
  for (size_t i = 0; i < order.size(); ++i) rank[order[i]] = i;
  RandomStream random(8);
  for (int i = 0; i < 200; ++i) {
    size_t next = 0;
    grid.ForEachIn(RandomCapsule(random, 100.0, 100.0, 0.2), [&](uint32_t idx) {
      EXPECT_GE(rank[idx], next);
      next = rank[idx] + 1;
    });
  }
}

TEST(FeatureGrid, RefusesEmptyImages) {
  const std::vector<Eigen::Vector2f> pixels = {{1.0f, 1.0f}};
  for (const float size : {0.0f, -1.0f, kNaN, kInfinity}) {
    EXPECT_THROW(FeatureGrid(pixels, size, 10.0f), std::invalid_argument);
    EXPECT_THROW(FeatureGrid(pixels, 10.0f, size), std::invalid_argument);
  }
  // Of the longest and narrowest there are not more cells than 1024 a side.
  EXPECT_NO_THROW(FeatureGrid(pixels, 1e9f, 1.0f));
  EXPECT_NO_THROW(FeatureGrid(pixels, 1e-20f, 1e20f));
}

}  // namespace
}  // namespace vgtw
