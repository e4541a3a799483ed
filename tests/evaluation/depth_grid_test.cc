// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/depth_grid.h"

#include "evaluation/prediction_filter.h"
#include "scene/rigid3d.h"
#include "scene/synthetic.h"
#include "tests/evaluation/made_clouds.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

TEST(ProjectPoints, EqualsNumpy) {
  Points points;
  for (int i = 0; i < 2000; ++i) {
    const double x = 6.0 * Fraction((i + 1) * 0.8191725134) - 3.0;
    const double y = 6.0 * Fraction((i + 1) * 0.6710436067) - 3.0;
    points.push_back({x, y, i % 4 == 3 ? 2.0 + 0.1 * x : 4.0 + 0.3 * y});
  }
  View view;
  view.camera = MakePinhole(12, 9, 10.0, 11.0);
  view.cam_from_world = {
      RotationAboutAxis(Eigen::Vector3d::UnitY(), 0.2 * 180.0 / std::numbers::pi),
      {0.1, -0.2, 0.3}};
  view.network_width = 12;
  view.network_height = 9;
  const DepthMap depth = ProjectPoints(view, points);
  const nlohmann::json golden = ReadGolden("depth_error")["z_buffer"];
  ASSERT_EQ(golden.size(), depth.size());
  for (size_t i = 0; i < depth.size(); ++i) {
    if (golden[i].is_null()) {
      EXPECT_TRUE(std::isnan(depth.data()[i]));
    } else {
      // Depths are floats.
      EXPECT_NEAR(depth.data()[i], golden[i].get<double>(), 1e-6);
    }
  }
}

TEST(ProjectPoints, ExactDepthComesBackToItsPixels) {
  SyntheticOptions options;
  options.num_views = 2;
  options.width = 160;
  options.height = 120;
  options.radial_distortion = 0.1;
  const Prediction truth = MakeTruePrediction(SyntheticScene(options), 112);
  for (const ViewPrediction& prediction : truth.views) {
    ViewPrediction filtered = prediction;
    filtered.distractor = {};
    filtered.depth_conf = {};
    const DepthMap depth = ProjectPoints(prediction.view, WorldPoints(filtered));
    ASSERT_EQ(depth.size(), prediction.depth.size());
    for (size_t i = 0; i < depth.size(); ++i) {
      const float expected = prediction.depth.data()[i];
      ASSERT_EQ(std::isnan(depth.data()[i]), std::isnan(expected));
      // Rounding of a float.
      if (std::isnan(expected)) continue;
      EXPECT_NEAR(depth.data()[i], expected, 1e-6 * expected);
    }
  }
}

TEST(ProjectPoints, NearestPointHidesTheOthersInAnyOrder) {
  const View view = MakeWallView("a.png", 0.0).view;
  for (const Points& points : {Points{{0.01, 0.01, 2.0}, {0.02, 0.02, 4.0}},
                               Points{{0.02, 0.02, 4.0}, {0.01, 0.01, 2.0}}}) {
    EXPECT_EQ(ProjectPoints(view, points)(16, 12), 2.0f);
  }
}

TEST(ProjectPoints, WhatIsBehindOrOutsideIsNotSeen) {
  const View view = MakeWallView("a.png", 0.0).view;
  const DepthMap depth = ProjectPoints(view, {{0.0, 0.0, -2.0}, {9.0, 0.0, 1.0}});
  for (const float value : depth.data()) EXPECT_TRUE(std::isnan(value));
}

TEST(RegridDepth, SameGridKeepsEveryValue) {
  ViewPrediction prediction = MakeWallView("a.png", 0.0);
  prediction.depth(3, 4) = 9.0f;  // a depth edge
  prediction.depth(5, 5) = kNaN;
  const DepthMap depth =
      RegridDepth(prediction.view, prediction.depth, prediction.view, /*max_relative_step=*/0.0);
  for (size_t i = 0; i < depth.size(); ++i) {
    const float expected = prediction.depth.data()[i];
    EXPECT_TRUE(depth.data()[i] == expected ||
                (std::isnan(depth.data()[i]) && std::isnan(expected)));
  }
}

TEST(RegridDepth, ReadsAtTheSamePlaceOfThePhoto) {
  // Depth that is linear in the photo is reproduced by bilinear reading on any other grid.
  ViewPrediction from = MakeWallView("a.png", 0.0);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 32; ++x) {
      from.depth(x, y) = static_cast<float>(10.0 + 0.1 * (2.0 * (x + 0.5)) + 0.05 * (2 * y + 1));
    }
  }
  View onto = from.view;
  onto.network_width = 64;
  onto.network_height = 24;
  onto.original_from_network << 1.0, 0.0, 0.0, 0.0, 1.0, 12.0;  // the middle rows
  const DepthMap depth = RegridDepth(from.view, from.depth, onto, 1.0);
  for (int y = 0; y < 24; ++y) {
    for (int x = 1; x < 63; ++x) {  // within half a pixel of the border values are the border's
      EXPECT_NEAR(depth(x, y), 10.0 + 0.1 * (x + 0.5) + 0.05 * (y + 12.5), 1e-5);
    }
  }
}

TEST(AddCommonDepths, TakesWhatBothKnowWithinTheLimit) {
  DepthMap predicted(4, 1, 2.0f);
  DepthMap expected(4, 1, 3.0f);
  predicted(0, 0) = kNaN;
  expected(1, 0) = 0.0f;
  expected(2, 0) = 5.0f;
  DepthPairs pairs;
  AddCommonDepths(predicted, expected, 4.0, pairs);
  EXPECT_EQ(pairs.predicted, std::vector<double>{2.0});
  EXPECT_EQ(pairs.expected, std::vector<double>{3.0});
  EXPECT_THROW(AddCommonDepths(DepthMap(1, 4), expected, 4.0, pairs), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
