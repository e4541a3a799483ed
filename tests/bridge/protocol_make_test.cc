// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/protocol_make.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Names = std::vector<std::string>;

Names Numbered(const std::string& prefix, int num, const std::string& extension = ".jpg") {
  Names names;
  for (int i = 0; i < num; ++i) names.push_back(prefix + std::to_string(100 + i) + extension);
  return names;
}

ProtocolSampling Sampling(uint64_t seed, uint64_t num_images, const std::string& test_images) {
  ProtocolSampling sampling;
  sampling.seed = seed;
  sampling.num_images = num_images;
  sampling.test_images = test_images;
  return sampling;
}

size_t NumStartingWith(const Names& names, const std::string& prefix) {
  return static_cast<size_t>(std::count_if(
      names.begin(), names.end(), [&](const auto& name) { return name.starts_with(prefix); }));
}

TEST(DrawImages, IsAFunctionOfSeedAndNamesWithoutExtension) {
  const ProtocolSampling sampling = Sampling(7, 10, "mixed");
  const DrawnImages drawn = DrawImages(Numbered("clean", 30), Numbered("clutter", 50), sampling);
  EXPECT_EQ(drawn.test, DrawImages(Numbered("clean", 30), Numbered("clutter", 50), sampling).test);
  Names as_png = drawn.test;
  for (std::string& name : as_png) name.replace(name.size() - 3, 3, "png");
  EXPECT_EQ(
      as_png,
      DrawImages(Numbered("clean", 30, ".png"), Numbered("clutter", 50, ".png"), sampling).test);
  EXPECT_NE(
      drawn.test,
      DrawImages(Numbered("clean", 30), Numbered("clutter", 50), Sampling(8, 10, "mixed")).test);
  EXPECT_TRUE(std::is_sorted(drawn.test.begin(), drawn.test.end()));
}

TEST(DrawImages, APhotoThatIsAddedChangesAtMostOne) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    const ProtocolSampling sampling = Sampling(seed, 10, "clutter");
    Names photos = Numbered("clutter", 40);
    const Names before = DrawImages({}, photos, sampling).test;
    photos.push_back("late.jpg");
    const Names after = DrawImages({}, photos, sampling).test;
    Names kept;
    std::set_intersection(
        before.begin(), before.end(), after.begin(), after.end(), std::back_inserter(kept));
    EXPECT_GE(kept.size(), 9u);
  }
}

TEST(DrawImages, EveryPhotoIsDrawnEquallyOften) {
  constexpr int kNumSeeds = 4000;
  constexpr double kProbability = 10.0 / 40.0;
  std::map<std::string, int> count;
  for (uint64_t seed = 0; seed < kNumSeeds; ++seed) {
    for (const std::string& name :
         DrawImages({}, Numbered("clutter", 40), Sampling(seed, 10, "clutter")).test) {
      ++count[name];
    }
  }
  ASSERT_EQ(count.size(), 40u);
  // 4.5 standard deviations of a binomial count: 40 counts pass with 99.97 %; seeds are fixed.
  const double tolerance = 4.5 * std::sqrt(kNumSeeds * kProbability * (1.0 - kProbability));
  for (const auto& [name, num] : count) EXPECT_NEAR(num, kNumSeeds * kProbability, tolerance);
}

TEST(DrawImages, MixedHasTheSharedPhotosItWasAskedFor) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    ProtocolSampling sampling = Sampling(seed, 10, "mixed");
    sampling.min_shared_images = 3;
    const Names test = DrawImages(Numbered("clean", 5), Numbered("clutter", 500), sampling).test;
    EXPECT_EQ(test.size(), 10u);
    EXPECT_GE(NumStartingWith(test, "clean"), 3u);
    sampling.min_shared_images = 0;
    // What is drawn by rank stays, but for those that make room.
    const Names by_rank = DrawImages(Numbered("clean", 5), Numbered("clutter", 500), sampling).test;
    Names kept;
    std::set_intersection(
        test.begin(), test.end(), by_rank.begin(), by_rank.end(), std::back_inserter(kept));
    EXPECT_GE(kept.size(), 7u);
  }
}

TEST(DrawImages, OfOneKindTakesThatKindAlone) {
  const Names clean = Numbered("clean", 30);
  const Names clutter = Numbered("clutter", 30);
  EXPECT_EQ(NumStartingWith(DrawImages(clean, clutter, Sampling(0, 10, "clean")).test, "clean"),
            10u);
  const DrawnImages drawn = DrawImages(clean, clutter, Sampling(0, 10, "clutter"));
  EXPECT_EQ(NumStartingWith(drawn.test, "clutter"), 10u);
  EXPECT_EQ(drawn.clean, clean);  // all of them
}

TEST(DrawImages, CleanPhotosHoldTheCleanTestImages) {
  for (uint64_t seed = 0; seed < 30; ++seed) {
    ProtocolSampling sampling = Sampling(seed, 10, "mixed");
    sampling.num_clean_images = 8;
    const DrawnImages drawn = DrawImages(Numbered("clean", 40), Numbered("clutter", 40), sampling);
    EXPECT_EQ(drawn.clean.size(), std::max<size_t>(8, NumStartingWith(drawn.test, "clean")));
    for (const std::string& name : drawn.test) {
      if (name.starts_with("clean")) {
        EXPECT_THAT(drawn.clean, testing::Contains(name));
      }
    }
  }
}

TEST(MakeProtocolScenes, RefusesASceneWithoutPhotosOfTheKind) {
  DatasetScene scene{.name = "camel", .title = "camel", .group = ""};
  scene.clutter = Numbered("", 20);
  EXPECT_EQ(MakeProtocolScenes({scene}, Sampling(0, 10, "mixed")).at(0).test_images.size(), 10u);
  EXPECT_THROW(MakeProtocolScenes({scene}, Sampling(0, 10, "clean")), Error);
}

}  // namespace
}  // namespace vgtw
