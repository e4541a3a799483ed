// SPDX-License-Identifier: BSD-3-Clause
#include "matching/window_search.h"

#include "scene/random.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// A keypoint and a descriptor of two bytes, so that distances are easy: (a, b).
struct Sample {
  Eigen::Vector2f pixel;
  std::array<uint8_t, 2> descriptor;
  float scale = 1.0f;
};

MatchingView MakeView(const std::vector<Sample>& samples) {
  ViewFeatures features;
  features.view.camera = MakePinhole(1000, 1000, 900.0, 900.0);
  features.descriptors = {static_cast<uint32_t>(samples.size()), 2, 0, {}};
  for (const Sample& sample : samples) {
    features.pixels.push_back(sample.pixel);
    features.rays.push_back((sample.pixel - Eigen::Vector2f(500.0f, 500.0f)) / 900.0f);
    features.scales.push_back(sample.scale);
    features.depths.push_back(std::numeric_limits<float>::quiet_NaN());
    features.depth_confs.push_back(0.0f);
    features.descriptors.data.insert(
        features.descriptors.data.end(), sample.descriptor.begin(), sample.descriptor.end());
  }
  return MatchingView(std::move(features));
}

// A circle around the same pixel.
WindowOfFeature Around(const MatchingView& view1, float radius, float scale_ratio = 0.0f) {
  return [&view1, radius, scale_ratio](uint32_t idx1) {
    const Eigen::Vector2f& pixel = view1.features().pixels[idx1];
    return SearchWindow{{pixel, pixel, radius}, pixel, scale_ratio};
  };
}

std::vector<uint32_t> AllOf(const MatchingView& view) {
  std::vector<uint32_t> idxs(view.features().size());
  std::iota(idxs.begin(), idxs.end(), 0u);
  return idxs;
}

constexpr WindowSearchOptions kOptions = {0.8, 0.9, 2.0};

FeatureMatches Search(const MatchingView& view1,
                      const MatchingView& view2,
                      const WindowOfFeature& window_of,
                      const MayMatch& may_match = {},
                      const WindowSearchOptions& options = kOptions) {
  return SearchWindows(view1, view2, AllOf(view1), window_of, may_match, options);
}

TEST(SearchWindows, TheNearestOutsideOfTheWindowDoesNotCount) {
  const auto view1 = MakeView({{{100, 100}, {50, 50}}});
  const auto view2 = MakeView({{{500, 500}, {50, 46}}, {{105, 100}, {56, 50}}});
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f)), (FeatureMatches{{0, 1}}));
  EXPECT_EQ(Search(view1, view2, Around(view1, 5.0f)), (FeatureMatches{{0, 1}}));  // on its rim
  EXPECT_EQ(Search(view1, view2, Around(view1, 4.9f)), FeatureMatches{});
  EXPECT_EQ(Search(view1, view2, Around(view1, 1000.0f)), (FeatureMatches{{0, 0}}));
}

// The second is at 10.
TEST(SearchWindows, RatioIsOfDistancesNotOfTheirSquares) {
  const auto view1 = MakeView({{{100, 100}, {50, 50}}});
  const auto at = [&](uint8_t nearest) {
    const auto view2 =
        MakeView({{{101, 100}, {static_cast<uint8_t>(50 + nearest), 50}}, {{99, 100}, {50, 60}}});
    return Search(view1, view2, Around(view1, 10.0f));
  };
  EXPECT_EQ(at(7), (FeatureMatches{{0, 0}}));
  EXPECT_EQ(at(9), FeatureMatches{});
  // A tie, even at distance 0, tells nothing.
  EXPECT_EQ(at(10), FeatureMatches{});
  const auto twins = MakeView({{{101, 100}, {50, 50}}, {{99, 100}, {50, 50}}});
  EXPECT_EQ(Search(view1, twins, Around(view1, 10.0f)), FeatureMatches{});
  WindowSearchOptions lax = kOptions;
  lax.max_ratio = 1.0;
  EXPECT_EQ(Search(view1, twins, Around(view1, 10.0f), {}, lax), FeatureMatches{});
}

TEST(SearchWindows, SecondBestCountsFromBothSides) {
  // One feature of view 2, two of view 1 that want it, nearly alike.
  const auto view1 = MakeView({{{100, 100}, {50, 59}}, {{104, 100}, {50, 60}}});
  const auto view2 = MakeView({{{102, 100}, {50, 50}}});
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f)), FeatureMatches{});
  // The other one does not see it: nothing competes.
  const auto apart = MakeView({{{100, 100}, {50, 59}}, {{115, 100}, {50, 60}}});
  EXPECT_EQ(Search(apart, view2, Around(apart, 10.0f)), (FeatureMatches{{0, 0}}));
}

TEST(SearchWindows, IsMutual) {
  const auto view1 = MakeView({{{100, 100}, {50, 50}}, {{104, 100}, {50, 53}}});
  const auto view2 = MakeView({{{102, 100}, {50, 54}}, {{700, 700}, {0, 0}}});
  // Both want 0; it is nearer to 1.
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f)), (FeatureMatches{{1, 0}}));
}

// A feature that is as near to something elsewhere in its own photo is a repeated one.
TEST(SearchWindows, BackgroundTestSeesRepetitionOutsideOfTheWindow) {
  const auto view1 = MakeView({{{100, 100}, {50, 50}}});
  const auto with_copy = [&](uint8_t offset) {
    return MakeView(
        {{{101, 100}, {59, 50}}, {{800, 800}, {static_cast<uint8_t>(59 + offset), 50}}});
  };
  // The match at 9 is nearer than 0.9 times 11, not than 0.9 times 9.
  EXPECT_EQ(Search(view1, with_copy(9), Around(view1, 10.0f)), FeatureMatches{});
  EXPECT_EQ(Search(view1, with_copy(11), Around(view1, 10.0f)), (FeatureMatches{{0, 0}}));
  // The same in the first photo.
  const auto view2 = MakeView({{{101, 100}, {59, 50}}});
  const auto copy_in_1 = MakeView({{{100, 100}, {50, 50}}, {{800, 800}, {50, 59}}});
  EXPECT_EQ(Search(copy_in_1, view2, Around(copy_in_1, 10.0f)), FeatureMatches{});
  // Its neighbour within 2 % of the image is its own texture.
  const auto own = MakeView({{{100, 100}, {50, 50}}, {{115, 100}, {50, 59}}});
  EXPECT_EQ(Search(own, view2, Around(own, 10.0f)), (FeatureMatches{{0, 0}}));
}

TEST(SearchWindows, ExactRepetitionDoesNotPassTheBackgroundTest) {
  const auto view1 = MakeView({{{100, 100}, {50, 50}}});
  const auto view2 = MakeView({{{101, 100}, {50, 50}}, {{800, 800}, {50, 50}}});
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f)), FeatureMatches{});
}

TEST(SearchWindows, ScalesAgreeUpToTheFactor) {
  for (const auto& [scale2, is_match] : {std::pair(6.0f, true),
                                         std::pair(12.0f, true),
                                         std::pair(12.1f, false),
                                         std::pair(3.0f, true),
                                         std::pair(2.9f, false),
                                         std::pair(0.0f, true)}) {
    const auto view1 = MakeView({{{100, 100}, {50, 50}, 2.0f}});
    const auto view2 = MakeView({{{101, 100}, {50, 50}, scale2}});
    // Predicted: 2 * 3 = 6.
    EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f, 3.0f)).size(), is_match ? 1u : 0u)
        << scale2;
    EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f, 0.0f)).size(), 1u);  // nothing is known
  }
  const auto view1 = MakeView({{{100, 100}, {50, 50}, 0.0f}});
  const auto view2 = MakeView({{{101, 100}, {50, 50}, 100.0f}});
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f, 3.0f)).size(), 1u);
}

// What may not match does not compete either.
TEST(SearchWindows, MayMatchDecidesWhoCompetes) {
  const auto view1 = MakeView({{{100, 100}, {50, 50}}});
  const auto view2 = MakeView({{{101, 100}, {50, 50}}, {{99, 100}, {50, 51}}});
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f)), (FeatureMatches{{0, 0}}));
  const MayMatch not_first = [](uint32_t, uint32_t idx2) { return idx2 != 0; };
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f), not_first), (FeatureMatches{{0, 1}}));
  const MayMatch none = [](uint32_t, uint32_t) { return false; };
  EXPECT_EQ(Search(view1, view2, Around(view1, 10.0f), none), FeatureMatches{});
}

TEST(SearchWindows, OnlyTheFeaturesAskedForWithWindows) {
  const auto view1 =
      MakeView({{{100, 100}, {0, 0}}, {{300, 100}, {80, 0}}, {{500, 100}, {160, 0}}});
  const auto view2 =
      MakeView({{{500, 101}, {160, 1}}, {{300, 101}, {80, 1}}, {{100, 101}, {0, 1}}});
  EXPECT_EQ(Search(view1, view2, Around(view1, 5.0f)), (FeatureMatches{{0, 2}, {1, 1}, {2, 0}}));
  const std::vector<uint32_t> idxs1 = {2, 0};
  EXPECT_EQ(SearchWindows(view1, view2, idxs1, Around(view1, 5.0f), {}, kOptions),
            (FeatureMatches{{0, 2}, {2, 0}}));
  const WindowOfFeature not_first = [&](uint32_t idx1) -> std::optional<SearchWindow> {
    if (idx1 == 0) return std::nullopt;
    return Around(view1, 5.0f)(idx1);
  };
  EXPECT_EQ(Search(view1, view2, not_first), (FeatureMatches{{1, 1}, {2, 0}}));
  EXPECT_EQ(SearchWindows(view1, view2, {}, Around(view1, 5.0f), {}, kOptions), FeatureMatches{});
}

std::vector<Sample> RandomSamples(size_t count, uint64_t seed) {
  RandomStream random(seed);
  std::vector<Sample> samples;
  for (size_t i = 0; i < count; ++i) {
    const auto x = static_cast<float>(random.Uniform(0.0, 1000.0));
    const auto y = static_cast<float>(random.Uniform(0.0, 1000.0));
    const auto a = static_cast<uint8_t>(random.Bits() >> 56);
    samples.push_back({{x, y}, {a, static_cast<uint8_t>(random.Bits() >> 56)}});
  }
  return samples;
}

// Windows that hold everything are no windows.
TEST(SearchAll, EqualsSearchInUnboundedWindows) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const auto view1 = MakeView(RandomSamples(150, HashKey({1, seed})));
    const auto view2 = MakeView(RandomSamples(130, HashKey({2, seed})));
    const FeatureMatches all = SearchAll(view1, view2, AllOf(view1), AllOf(view2), kOptions);
    EXPECT_GT(all.size(), 3u);
    EXPECT_EQ(all, Search(view1, view2, Around(view1, 5000.0f)));
  }
}

// Nothing is preferred for standing on one side.
TEST(SearchAll, IsTheSameFromBothSides) {
  const auto view1 = MakeView(RandomSamples(150, 3));
  const auto view2 = MakeView(RandomSamples(130, 4));
  const FeatureMatches there = SearchAll(view1, view2, AllOf(view1), AllOf(view2), kOptions);
  FeatureMatches back = SearchAll(view2, view1, AllOf(view2), AllOf(view1), kOptions);
  for (auto& match : back) std::swap(match[0], match[1]);
  std::sort(back.begin(), back.end());
  EXPECT_EQ(there, back);
}

TEST(SearchAll, OnlyTheFeaturesAskedFor) {
  const auto view1 =
      MakeView({{{100, 100}, {0, 0}}, {{300, 100}, {80, 0}}, {{500, 100}, {160, 0}}});
  const auto view2 =
      MakeView({{{500, 101}, {160, 1}}, {{300, 101}, {80, 1}}, {{100, 101}, {0, 1}}});
  const std::vector<uint32_t> idxs1 = {0, 1};
  const std::vector<uint32_t> idxs2 = {0, 1};
  // 0 has lost its counterpart 2; the nearest of the rest is nearer to 1.
  EXPECT_EQ(SearchAll(view1, view2, idxs1, idxs2, kOptions), (FeatureMatches{{1, 1}}));
  EXPECT_EQ(SearchAll(view1, view2, {}, idxs2, kOptions), FeatureMatches{});
  EXPECT_EQ(SearchAll(view1, view2, idxs1, {}, kOptions), FeatureMatches{});
}

TEST(SearchAll, EmptyViewsMatchNothing) {
  const auto empty = MakeView({});
  const auto view = MakeView({{{100, 100}, {0, 0}}});
  EXPECT_EQ(SearchAll(empty, view, {}, AllOf(view), kOptions), FeatureMatches{});
  EXPECT_EQ(Search(view, empty, Around(view, 10.0f)), FeatureMatches{});
  EXPECT_EQ(Search(empty, empty, Around(empty, 10.0f)), FeatureMatches{});
}

TEST(WindowSearchOptions, RefusesNonsense) {
  const auto view = MakeView({{{100, 100}, {0, 0}}});
  for (const WindowSearchOptions& options : {WindowSearchOptions{0.0, 0.9, 2.0},
                                             WindowSearchOptions{1.1, 0.9, 2.0},
                                             WindowSearchOptions{0.8, 0.0, 2.0},
                                             WindowSearchOptions{0.8, 1.1, 2.0},
                                             WindowSearchOptions{0.8, 0.9, 0.9}}) {
    EXPECT_THROW(options.Check(), std::invalid_argument);
    EXPECT_THROW(SearchAll(view, view, {}, {}, options), std::invalid_argument);
    EXPECT_THROW(Search(view, view, Around(view, 1.0f), {}, options), std::invalid_argument);
  }
}

}  // namespace
}  // namespace vgtw
