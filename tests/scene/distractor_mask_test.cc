// SPDX-License-Identifier: BSD-3-Clause
#include "scene/distractor_mask.h"

#include "scene/random.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

// A view of width x height whose network saw it `scale` times smaller.
View MakeView(uint64_t width, uint64_t height, int network_width, int network_height) {
  View view;
  view.name = "a.jpg";
  view.camera = MakePinhole(width, height, 100.0, 100.0);
  view.network_width = network_width;
  view.network_height = network_height;
  view.original_from_network << static_cast<double>(width) / network_width, 0.0, 0.0,  //
      0.0, static_cast<double>(height) / network_height, 0.0;
  return view;
}

View MakeFullSizeView(int width, int height) {
  return MakeView(static_cast<uint64_t>(width), static_cast<uint64_t>(height), width, height);
}

constexpr StaticMaskOptions kPlain{.dilate_px = 0};

// Random blotches of some pixels, for comparison with brute force.
DistractorMask RandomMask(int width, int height, uint64_t seed) {
  RandomStream random(seed);
  DistractorMask distractor(width, height, 0.0f);
  for (int i = 0; i < 12; ++i) {
    const int x0 = static_cast<int>(random.Uniform(0.0, width));
    const int y0 = static_cast<int>(random.Uniform(0.0, height));
    const int size = static_cast<int>(random.Uniform(1.0, 14.0));
    for (int y = y0; y < std::min(y0 + size, height); ++y) {
      for (int x = x0; x < std::min(x0 + size, width); ++x) distractor(x, y) = 1.0f;
    }
  }
  return distractor;
}

// Whether a pixel of `grid` equal to `value` has its centre within `radius` of (x, y)'s centre.
template <typename T>
bool HasWithin(const Grid<T>& grid, int x, int y, int radius, T value) {
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      if (dx * dx + dy * dy <= radius * radius && grid.Contains(x + dx, y + dy) &&
          grid(x + dx, y + dy) == value) {
        return true;
      }
    }
  }
  return false;
}

// Network 4 x 1 with centres 0.5, 1.5, 2.5, 3.5 and ten original pixels each: between 1.5 and 2.5
// the probability rises from 0 to 1, at original x it is (x / 10 - 1.5).
TEST(MakeStaticMask, EdgeLiesWhereTheUpsampledProbabilityReachesTheThreshold) {
  const View view = MakeView(40, 10, 4, 1);
  DistractorMask distractor(4, 1);
  distractor.data() = {0.0f, 0.0f, 1.0f, 1.0f};
  const auto first_excluded = [&](double threshold) {
    const StaticMask static_mask =
        MakeStaticMask(view, distractor, {.threshold = threshold, .dilate_px = 0});
    int x = 0;
    while (x < 40 && static_mask(x, 5) == 255) ++x;
    for (int i = 0; i < 40; ++i) EXPECT_EQ(static_mask(i, 5), i < x ? 255 : 0);
    return x;
  };
  EXPECT_EQ(first_excluded(0.5), 20);  // centre 20.5: 0.55, centre 19.5: 0.45
  EXPECT_EQ(first_excluded(0.8), 23);  // centre 23.5: 0.85, centre 22.5: 0.75
  EXPECT_EQ(first_excluded(0.2), 17);  // centre 17.5: 0.25, centre 16.5: 0.15
  EXPECT_EQ(first_excluded(1.0), 25);  // constant from the last rise on
}

// A ramp in both axes has a slanted edge: x / 10 + y / 10 = 4, exact on every row.
TEST(MakeStaticMask, EdgeIsSmoothBelowNetworkPixels) {
  const View view = MakeView(40, 40, 4, 4);
  DistractorMask distractor(4, 4);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) distractor(x, y) = static_cast<float>(x + y + 1) / 8.0f;
  }
  const StaticMask static_mask = MakeStaticMask(view, distractor, kPlain);
  for (int y = 5; y < 35; ++y) {
    for (int x = 5; x < 35; ++x) {
      const int sum_of_centres = x + y + 1;
      if (sum_of_centres != 40) {
        EXPECT_EQ(static_mask(x, y), sum_of_centres > 40 ? 0 : 255);
      }
    }
  }
}

TEST(MakeStaticMask, IsConstantInTheOutermostHalfPixel) {
  const View view = MakeView(40, 10, 4, 1);
  DistractorMask distractor(4, 1, 0.0f);
  distractor(0, 0) = 1.0f;
  const StaticMask static_mask = MakeStaticMask(view, distractor, kPlain);
  EXPECT_EQ(static_mask(0, 0), 0);
  EXPECT_EQ(static_mask(4, 9), 0);
  EXPECT_EQ(static_mask(9, 9), 0);     // centre 9.5: 0.55
  EXPECT_EQ(static_mask(10, 9), 255);  // centre 10.5: 0.45
}

// The network saw rows 10..30 of 40.
TEST(MakeStaticMask, PolicyDecidesAboutTheCroppedRows) {
  View view = MakeView(40, 20, 4, 2);
  view.camera = MakePinhole(40, 40, 100.0, 100.0);
  view.original_from_network(1, 2) = 10.0;
  const DistractorMask nothing(4, 2, 0.0f);
  const StaticMask kept = MakeStaticMask(view, nothing, kPlain);
  EXPECT_EQ(ExcludedShare(kept), 0.0);
  const StaticMask excluded =
      MakeStaticMask(view, nothing, {.dilate_px = 0, .unknown = UnknownPolicy::kExclude});
  for (int y = 0; y < 40; ++y) EXPECT_EQ(excluded(7, y), y < 10 || y >= 30 ? 0 : 255) << y;
}

TEST(MakeStaticMask, MarginReachesIntoTheCroppedRows) {
  View view = MakeView(40, 20, 4, 2);
  view.camera = MakePinhole(40, 40, 100.0, 100.0);
  view.original_from_network(1, 2) = 10.0;
  const StaticMask static_mask = MakeStaticMask(view, {4, 2, 1.0f}, {.dilate_px = 3});
  for (int y = 0; y < 40; ++y) EXPECT_EQ(static_mask(7, y), y < 7 || y >= 33 ? 255 : 0) << y;
}

// Between a known and an unknown network pixel nothing is known.
TEST(MakeStaticMask, UnknownSpreadsToItsNeighboursOnly) {
  const View view = MakeView(40, 10, 4, 1);
  DistractorMask distractor(4, 1, 0.0f);
  distractor(3, 0) = kUnknown;
  const StaticMask static_mask =
      MakeStaticMask(view, distractor, {.dilate_px = 0, .unknown = UnknownPolicy::kExclude});
  for (int x = 0; x < 40; ++x) EXPECT_EQ(static_mask(x, 0), x < 25 ? 255 : 0) << x;
}

TEST(MakeStaticMask, PredictionlessViewIsAllUnknown) {
  View view = MakeFullSizeView(6, 4);
  view.network_width = view.network_height = 0;
  EXPECT_EQ(ExcludedShare(MakeStaticMask(view, {}, kPlain)), 0.0);
  EXPECT_EQ(ExcludedShare(MakeStaticMask(view, {}, {.unknown = UnknownPolicy::kExclude})), 1.0);
}

// A network that looked at the photo turned by 90 degrees.
TEST(MakeStaticMask, FollowsTurnedMaps) {
  View view = MakeFullSizeView(5, 3);
  view.network_width = 3;
  view.network_height = 5;
  view.original_from_network << 0.0, 1.0, 0.0, -1.0, 0.0, 3.0;  // x = v, y = 3 - u
  DistractorMask distractor(3, 5, 0.0f);
  distractor(0, 4) = 1.0f;  // centre (0.5, 4.5) -> (4.5, 2.5)
  const StaticMask static_mask = MakeStaticMask(view, distractor, kPlain);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) EXPECT_EQ(static_mask(x, y), x == 4 && y == 2 ? 0 : 255);
  }
}

TEST(MakeStaticMask, DilatesByAnExactDisc) {
  const View view = MakeFullSizeView(60, 50);
  const DistractorMask distractor = RandomMask(60, 50, 1);
  for (const int radius : {1, 2, 5, 7, 10, 13}) {
    const StaticMask static_mask = MakeStaticMask(view, distractor, {.dilate_px = radius});
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 60; ++x) {
        ASSERT_EQ(static_mask(x, y) == 0, HasWithin(distractor, x, y, radius, 1.0f))
            << radius << " " << x << " " << y;
      }
    }
  }
}

// Pixels outside the image are not static: they erode nothing.
TEST(MakeStaticMask, ErodesByAnExactDisc) {
  const View view = MakeFullSizeView(60, 50);
  const DistractorMask distractor = RandomMask(60, 50, 2);
  for (const int radius : {1, 2, 5}) {
    const StaticMask static_mask =
        MakeStaticMask(view, distractor, {.dilate_px = 0, .erode_px = radius});
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 60; ++x) {
        ASSERT_EQ(static_mask(x, y) == 0, !HasWithin(distractor, x, y, radius, 0.0f))
            << radius << " " << x << " " << y;
      }
    }
  }
}

TEST(MakeStaticMask, ErosionComesBeforeDilation) {
  const View view = MakeFullSizeView(40, 40);
  DistractorMask distractor(40, 40, 0.0f);
  distractor(5, 5) = 1.0f;  // a speck
  for (int y = 15; y < 30; ++y) {
    for (int x = 15; x < 30; ++x) distractor(x, y) = 1.0f;
  }
  const StaticMask static_mask = MakeStaticMask(view, distractor, {.dilate_px = 2, .erode_px = 2});
  EXPECT_EQ(static_mask(5, 5), 255);
  EXPECT_EQ(static_mask(22, 22), 0);
  EXPECT_EQ(static_mask(15, 22), 0);
  EXPECT_EQ(static_mask(14, 22), 255);
}

TEST(MakeStaticMask, CountsAreasByEightNeighbours) {
  const View view = MakeFullSizeView(20, 20);
  DistractorMask distractor(20, 20, 0.0f);
  for (int i = 0; i < 5; ++i) distractor(3 + i, 3 + i) = 1.0f;  // 5 pixels joined by corners
  distractor(15, 4) = distractor(16, 4) = 1.0f;                 // 2 pixels
  const StaticMask static_mask =
      MakeStaticMask(view, distractor, {.dilate_px = 0, .min_area_px = 5});
  EXPECT_EQ(static_mask(5, 5), 0);
  EXPECT_EQ(static_mask(15, 4), 255);
  EXPECT_DOUBLE_EQ(ExcludedShare(static_mask), 5.0 / 400.0);
}

TEST(MakeStaticMask, FillsClosedHolesOnly) {
  const View view = MakeFullSizeView(20, 20);
  DistractorMask distractor(20, 20, 0.0f);
  for (int i = 2; i < 9; ++i) {  // a ring around 5 x 5 pixels
    distractor(i, 2) = distractor(i, 8) = distractor(2, i) = distractor(8, i) = 1.0f;
  }
  distractor(17, 0) = distractor(18, 1) = distractor(19, 2) = 1.0f;  // cuts off the image corner
  const auto excluded = [&](int fill_holes_px) {
    return MakeStaticMask(view, distractor, {.dilate_px = 0, .fill_holes_px = fill_holes_px});
  };
  EXPECT_EQ(excluded(25)(5, 5), 255);  // 25 is not below 25
  EXPECT_EQ(excluded(26)(5, 5), 0);
  EXPECT_EQ(excluded(26)(19, 0), 255);
  EXPECT_EQ(excluded(26)(12, 12), 255);
}

TEST(MakeStaticMask, RefusesAnotherSizeAndBadOptions) {
  const View view = MakeFullSizeView(4, 4);
  EXPECT_THROW(MakeStaticMask(view, DistractorMask(4, 3), kPlain), std::invalid_argument);
  const DistractorMask distractor(4, 4);
  EXPECT_THROW(MakeStaticMask(view, distractor, {.threshold = 0.0}), std::invalid_argument);
  EXPECT_THROW(MakeStaticMask(view, distractor, {.threshold = 1.1}), std::invalid_argument);
  EXPECT_THROW(MakeStaticMask(view, distractor, {.dilate_px = -1}), std::invalid_argument);
}

TEST(IsExcluded, TestsTheFlooredPixelAndTreatsOutsideAsExcluded) {
  StaticMask static_mask(3, 2, 255);
  static_mask(1, 0) = 0;
  EXPECT_FALSE(IsExcluded(static_mask, 0.99, 0.0));
  EXPECT_TRUE(IsExcluded(static_mask, 1.0, 0.99));
  EXPECT_FALSE(IsExcluded(static_mask, 2.999, 1.999));
  EXPECT_TRUE(IsExcluded(static_mask, 3.0, 1.0));
  EXPECT_TRUE(IsExcluded(static_mask, -0.01, 1.0));
  EXPECT_TRUE(IsExcluded(static_mask, 1e300, 1.0));
  EXPECT_TRUE(IsExcluded(static_mask, std::nan(""), 1.0));
  EXPECT_TRUE(IsExcluded(StaticMask(), 0.0, 0.0));
}

TEST(DistanceToExcluded, IsThatOfPixelCentres) {
  StaticMask static_mask(6, 5, 255);
  static_mask(1, 1) = 0;
  const Grid<float> distance = DistanceToExcluded(static_mask);
  EXPECT_EQ(distance(1, 1), 0.0f);
  EXPECT_EQ(distance(0, 1), 1.0f);
  EXPECT_FLOAT_EQ(distance(4, 4), std::sqrt(18.0f));
  EXPECT_FLOAT_EQ(distance(5, 4), 5.0f);
  EXPECT_EQ(DistanceToExcluded(StaticMask(2, 2, 255))(0, 0),
            std::numeric_limits<float>::infinity());
  EXPECT_EQ(DistanceToExcluded(StaticMask(2, 2, 0))(0, 0), 0.0f);
  EXPECT_TRUE(DistanceToExcluded(StaticMask()).empty());
}

TEST(ExcludedShare, CountsZeros) {
  StaticMask static_mask(4, 2, 1);
  static_mask(0, 0) = static_mask(3, 1) = 0;
  EXPECT_DOUBLE_EQ(ExcludedShare(static_mask), 0.25);
  EXPECT_DOUBLE_EQ(ExcludedShare(StaticMask()), 0.0);
}

}  // namespace
}  // namespace vgtw
