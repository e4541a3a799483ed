// SPDX-License-Identifier: BSD-3-Clause
#include "matching/depth_scales.h"

#include "scene/statistics.h"
#include "tests/matching/sample_tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Depths are floats, whose rounding is 6e-8 of them; medians do not add to it.
constexpr double kFloatTolerance = 3e-7;

RandomStream Random(uint64_t seed = 0) { return RandomStream(HashKey({seed, 23})); }

// True scales 1/1.25, 1, 1/0.9: their median is 1, so that the gauge leaves them as they are.
TEST(EstimateDepthScales, UndoesFactorsOfDepth) {
  for (const double forward : {0.0, 0.8}) {
    TrackScene scene = MakeWallScene(3, forward);
    RandomStream random = Random();
    ScaleDepths(1.25, 0.0, random, scene.views.at(1));
    ScaleDepths(0.9, 0.0, random, scene.views.at(3));
    const DepthScales scales = EstimateDepthScales(scene.views, scene.tracks);
    ASSERT_EQ(scales.size(), 3u);
    EXPECT_NEAR(scales.at(1).scale, 0.8, kFloatTolerance);
    EXPECT_EQ(scales.at(2).scale, 1.0);
    EXPECT_NEAR(scales.at(3).scale, 1.0 / 0.9, kFloatTolerance);
    for (const auto& [image_id, scale] : scales) {
      EXPECT_LT(scale.spread, kFloatTolerance);
      EXPECT_EQ(scale.num_links, 18u);  // nine points, two other views
    }
  }
}

// All depths too long by half: views side by side cannot tell, and the median stays 1.
TEST(EstimateDepthScales, LeavesACommonFactor) {
  TrackScene scene = MakeWallScene(4);
  RandomStream random = Random();
  for (auto& [image_id, view] : scene.views) ScaleDepths(1.5, 0.0, random, view);
  for (const auto& [image_id, scale] : EstimateDepthScales(scene.views, scene.tracks)) {
    EXPECT_NEAR(scale.scale, 1.0, kFloatTolerance);
  }
}

TEST(EstimateDepthScales, WithoutLinksScalesAreOne) {
  TrackScene scene = MakeWallScene(3);
  RandomStream random = Random();
  ScaleDepths(2.0, 0.0, random, scene.views.at(2));
  std::fill(scene.views.at(3).depths.begin(),
            scene.views.at(3).depths.end(),
            std::numeric_limits<float>::quiet_NaN());
  const DepthScales scales = EstimateDepthScales(scene.views, scene.tracks);
  EXPECT_EQ(scales.at(3).scale, 1.0);
  EXPECT_TRUE(std::isnan(scales.at(3).spread));
  EXPECT_EQ(scales.at(3).num_links, 0u);
  // Of two views the lower scale is the median.
  EXPECT_NEAR(scales.at(1).scale / scales.at(2).scale, 2.0, 2 * kFloatTolerance);
  EXPECT_EQ(scales.at(2).scale, 1.0);

  for (const auto& [image_id, scale] :
       EstimateDepthScales(scene.views, scene.tracks, {.min_links = 10})) {
    EXPECT_EQ(scale.scale, 1.0);
  }
  EXPECT_EQ(EstimateDepthScales(scene.views, {}).size(), 3u);
  EXPECT_TRUE(EstimateDepthScales({}, scene.tracks).empty());
}

TEST(EstimateDepthScales, EachSetOfLinkedViewsHasItsOwnMedian) {
  TrackScene scene = MakeWallScene(6);
  RandomStream random = Random();
  const std::vector<double> factors = {1.0, 1.1, 0.8, 2.0, 2.4, 1.8};
  for (ImageId id = 1; id <= 6; ++id) ScaleDepths(factors[id - 1], 0.0, random, scene.views.at(id));
  std::vector<std::vector<TrackElement>> halves;
  for (const auto& track : scene.tracks) {
    halves.emplace_back(track.begin(), track.begin() + 3);
    halves.emplace_back(track.begin() + 3, track.end());
  }
  const DepthScales scales = EstimateDepthScales(scene.views, halves);
  const std::vector<double> expected = {1.0, 1.0 / 1.1, 1.0 / 0.8, 1.0, 2.0 / 2.4, 2.0 / 1.8};
  for (ImageId id = 1; id <= 6; ++id) {
    EXPECT_NEAR(scales.at(id).scale, expected[id - 1], kFloatTolerance);
  }
}

// Depth without any relation to the scene, and a third of the tracks wrong.
TEST(EstimateDepthScales, BadViewsAndTracksDoNotMoveOthers) {
  TrackScene scene = MakeArcScene(8, 300, 60.0, 1);
  RandomStream random = Random();
  ScaleDepths(1.2, 0.0, random, scene.views.at(2));
  for (float& depth : scene.views.at(5).depths)
    depth = static_cast<float>(random.Uniform(1.0, 9.0));
  for (size_t i = 0; i + 2 < scene.tracks.size(); i += 3) {
    for (size_t k = 0; k < 4; ++k) std::swap(scene.tracks[i][k], scene.tracks[i + 1][k]);
  }
  // Two of three tracks now end in another one's second half, a third is as it was.
  const DepthScales scales = EstimateDepthScales(scene.views, scene.tracks);
  for (const auto& [image_id, scale] : scales) {
    if (image_id == 5) continue;
    // Medians of contaminated samples are not exact: half of the wrong links' share off the middle,
    // within depths that differ by 20 %.
    EXPECT_NEAR(scale.scale, image_id == 2 ? 1.0 / 1.2 : 1.0, 0.01) << image_id;
    EXPECT_LT(scale.spread, 0.1) << image_id;
  }
  EXPECT_GT(scales.at(5).spread, 0.2);
}

// Factors of 0 to 20 %, 3 % noise per depth, poses off by 1 degree and 2 % of the arc.
TEST(EstimateDepthScales, AreAccurateUnderNoise) {
  std::vector<double> errors;
  std::vector<double> errors_before;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    TrackScene scene = MakeArcScene(10, 200, 60.0, seed);
    RandomStream random = Random(seed);
    std::vector<double> log_factors;
    for (auto& [image_id, view] : scene.views) {
      const double factor = random.Uniform(0.8, 1.2);
      log_factors.push_back(std::log(factor));
      ScaleDepths(factor, 0.03, random, view);
      MoveView(1.0, 0.08, random, view);
    }
    std::vector<double> left;  // log of scale * factor: the same for all views if it is right
    for (const auto& [image_id, scale] : EstimateDepthScales(scene.views, scene.tracks)) {
      left.push_back(std::log(scale.scale) + log_factors[image_id - 1]);
      // Noise of 3 % and what pose errors do to z: 0.08 / sqrt(3) of 4 is 1.2 %.
      EXPECT_GT(scale.spread, 0.02);
      EXPECT_LT(scale.spread, 0.05);
    }
    for (const double x : left) errors.push_back(std::abs(x - Median(left)));
    for (const double x : log_factors) errors_before.push_back(std::abs(x - Median(log_factors)));
  }
  // A shift along the axis, 1.2 % of the distance per view (sigma), looks like a factor of depth.
  // Hence half of the errors lie within 0.67 sigma, and the largest of 100 within 3.5 sigma.
  EXPECT_LT(Median(errors), 0.67 * 0.012);
  EXPECT_LT(Percentile(errors, 100.0), 3.5 * 0.012);
  EXPECT_GT(Median(errors_before), 0.08);
}

TEST(EstimateDepthScales, RefusesWhatCannotBe) {
  TrackScene scene = MakeWallScene(2);
  EXPECT_THROW(EstimateDepthScales(scene.views, {{{1, 9}, {2, 0}}}), std::invalid_argument);
  EXPECT_THROW(EstimateDepthScales({}, {}, {.min_links = 0}), std::invalid_argument);
  EXPECT_THROW(EstimateDepthScales({}, {}, {.noise_floor = 0.0}), std::invalid_argument);
  EXPECT_THROW(EstimateDepthScales({}, {}, {.max_iterations = 0}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
