// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/prediction_filter.h"

#include "scene/sim3d.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr size_t kNumPixels = 32 * 24;

// Two views: confidences 1..768 by pixel in the first, 100 times that in the second; the first
// view's upper half is on distractors.
std::vector<ViewPrediction> TwoViews() {
  std::vector<ViewPrediction> views = {MakeWallView("a.png", -0.5), MakeWallView("b.png", 0.5)};
  for (size_t v = 0; v < 2; ++v) {
    views[v].depth_conf = ConfidenceMap(32, 24);
    views[v].distractor = DistractorMask(32, 24, 0.0f);
    for (size_t i = 0; i < kNumPixels; ++i) {
      views[v].depth_conf.data()[i] = static_cast<float>(i + 1) * (v == 0 ? 1.0f : 100.0f);
      if (v == 0 && i < kNumPixels / 2) views[v].distractor.data()[i] = 0.5f;
    }
  }
  return views;
}

PredictionFilter MakeFilter(const std::vector<ViewPrediction>& views,
                            const PredictionFilterOptions& options) {
  return {views.size(), [views](size_t i) { return views[i]; }, options};
}

size_t NumKnown(const DepthMap& depth) {
  size_t num_known = 0;
  for (const float value : depth.data()) num_known += std::isfinite(value);
  return num_known;
}

// Thresholds are exact to 0.05 % of a confidence, which here is less than two pixels' worth.
constexpr double kPixels = 1.5;

TEST(PredictionFilter, PooledShareFavoursTheConfidentView) {
  PredictionFilterOptions options;
  options.keep_percent = 25.0;
  const PredictionFilter filter = MakeFilter(TwoViews(), options);
  EXPECT_NEAR(filter.pooled_threshold(), 100.0 * 0.5 * kNumPixels, 100.0 * kPixels);
  EXPECT_EQ(NumKnown(filter.Filtered(0).depth), 0u);
  EXPECT_NEAR(double(NumKnown(filter.Filtered(1).depth)), 0.25 * 2 * kNumPixels, kPixels);
}

TEST(PredictionFilter, ShareOfEachViewIsTakenBeforeOrAfterDistractors) {
  PredictionFilterOptions options;
  options.pool_views = false;
  options.keep_percent = 75.0;
  const auto num_known = [&](size_t view_idx) {
    return double(NumKnown(MakeFilter(TwoViews(), options).Filtered(view_idx).depth));
  };
  // Before: the most confident 75 % without the half on distractors, which has the least.
  EXPECT_NEAR(num_known(0), 0.5 * kNumPixels, kPixels);
  EXPECT_NEAR(num_known(1), 0.75 * kNumPixels, kPixels);
  // After: 75 % of the other half.
  options.percent_of_all = false;
  EXPECT_NEAR(num_known(0), 0.375 * kNumPixels, kPixels);
  EXPECT_NEAR(num_known(1), 0.75 * kNumPixels, kPixels);
}

TEST(PredictionFilter, EverythingStaticIsKeptAtAHundredPercent) {
  PredictionFilterOptions options;
  options.keep_percent = 100.0;
  std::vector<ViewPrediction> views = TwoViews();
  views[1].depth_conf(0, 0) = 0.0f;
  views[1].distractor(1, 0) = kNaN;  // unknown is not static
  views[1].depth(2, 0) = kNaN;
  const ViewPrediction filtered = MakeFilter(views, options).Filtered(1);
  EXPECT_EQ(NumKnown(filtered.depth), kNumPixels - 2);
  EXPECT_EQ(NumKnown(MakeFilter(views, options).Filtered(0).depth), kNumPixels / 2);
}

TEST(PredictionFilter, WithoutConfidencesEveryDepthIsKept) {
  EXPECT_EQ(NumKnown(MakeFilter({MakeWallView("a.png", 0.0)}, {}).Filtered(0).depth), kNumPixels);
}

TEST(PredictionFilter, SamplesStandInForMaps) {
  ViewPrediction view = MakeWallView("a.png", 0.0);
  view.depth = {};
  view.distractor = DistractorMask(32, 24, 0.0f);
  view.distractor(0, 0) = 1.0f;
  view.depth_samples = {{{1.0f, 1.0f}, 5.0f, 9.0f},    // on the distractor
                        {{32.0f, 24.0f}, 5.0f, 9.0f},  // on the axis
                        {{40.0f, 24.0f}, 5.0f, 1.0f}};
  PredictionFilterOptions options;
  options.keep_percent = 60.0;
  const auto points = WorldPoints(MakeFilter({view}, options));
  ASSERT_EQ(points.size(), 1u);
  EXPECT_LT((points[0] - Eigen::Vector3d(0.0, 0.0, 5.0)).norm(), 1e-6);
}

TEST(PredictionFilter, PointsStandInForDepth) {
  ViewPrediction view = MakeWallView("a.png", 0.0);
  view.depth = {};
  view.points = Grid<Eigen::Vector3f>(32, 24, Eigen::Vector3f(0.0f, 0.0f, 2.0f));
  EXPECT_EQ(MakeFilter({view}, {}).Filtered(0).depth(5, 5), 2.0f);
}

TEST(WorldPoints, FollowTheViews) {
  PredictionFilterOptions options;
  options.keep_percent = 100.0;
  const std::vector<ViewPrediction> views = {MakeWallView("a.png", -0.5),
                                             MakeWallView("b.png", 0.5)};
  const auto points = WorldPoints(MakeFilter(views, options), 2);
  ASSERT_EQ(points.size(), 2 * kNumPixels);
  for (size_t i = 0; i < kNumPixels; ++i) {
    const Eigen::Vector3d step = points[kNumPixels + i] - points[i];
    EXPECT_LT((step - Eigen::Vector3d(1.0, 0.0, 0.0)).norm(), 1e-12);
    EXPECT_NEAR(points[i].z(), kWallDepth, 1e-6);
  }
}

TEST(AddPixelPairs, GiveTheSimilarityBetweenTwoWorlds) {
  const Sim3d reference_from_prediction = {
      2.0, Eigen::Quaterniond(0.5, 0.5, 0.5, -0.5), {1.0, 2.0, 3.0}};
  ViewPrediction prediction = MakeWallView("a.png", -0.5);
  ViewPrediction reference = prediction;
  for (int x = 0; x < 32; ++x) prediction.depth(x, 5) = 4.0f;  // no plane
  reference.depth = prediction.depth;
  for (float& depth : reference.depth.data()) depth *= 2.0f;
  reference.view.cam_from_world =
      TransformCamera(reference_from_prediction, prediction.view.cam_from_world);
  prediction.depth(0, 0) = kNaN;
  reference.depth(1, 0) = kNaN;
  PointPairs pairs;
  AddPixelPairs(prediction, reference, pairs);
  ASSERT_EQ(pairs.in_prediction.size(), kNumPixels - 2);
  const auto found = EstimateSim3d(pairs.in_prediction, pairs.in_reference);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->scale, 2.0, 1e-12);
  EXPECT_LT(AngleBetweenDeg(found->rotation, reference_from_prediction.rotation), 1e-6);
  EXPECT_LT((found->translation - reference_from_prediction.translation).norm(), 1e-11);
}

TEST(AddPixelPairs, OtherGridsMeetAtTheSamePlaceOfThePhoto) {
  const ViewPrediction prediction = MakeWallView("a.png", 0.0);
  ViewPrediction reference = prediction;
  reference.view.network_width = 64;
  reference.view.network_height = 48;
  reference.view.original_from_network = IdentityPixelMap();
  reference.depth = DepthMap(64, 48, static_cast<float>(kWallDepth));
  PointPairs pairs;
  AddPixelPairs(prediction, reference, pairs);
  ASSERT_EQ(pairs.in_prediction.size(), kNumPixels);
  for (size_t i = 0; i < kNumPixels; ++i) {
    EXPECT_LT((pairs.in_prediction[i] - pairs.in_reference[i]).norm(), 1e-6);
  }
}

TEST(PredictionFilterOptions, AreChecked) {
  PredictionFilterOptions options;
  options.keep_percent = 0.0;
  EXPECT_THROW(options.Check(), std::invalid_argument);
  options.keep_percent = 50.0;
  options.distractor_threshold = 1.5;
  EXPECT_THROW(options.Check(), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
