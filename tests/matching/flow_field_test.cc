// SPDX-License-Identifier: BSD-3-Clause
#include "matching/flow_field.h"

#include "scene/random.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Anchors = std::vector<FlowField::Anchor>;

// `count` anchors in a row, 10 px apart, the i-th with the flow (i, -2 i).
Anchors Ramp(int count) {
  Anchors anchors;
  for (int i = 0; i < count; ++i) {
    const auto value = static_cast<float>(i);
    anchors.push_back({{10.0f * value, 0.0f}, {value, -2.0f * value}});
  }
  return anchors;
}

TEST(FlowField, IsTheMedianOfTheFiveNearest) {
  const FlowField field(Ramp(20));
  ASSERT_TRUE(field.IsUsable());
  EXPECT_EQ(field.At({101.0f, 0.0f}), Eigen::Vector2f(10.0f, -20.0f));  // of 8 to 12
  EXPECT_EQ(field.At({104.9f, 3.0f}), Eigen::Vector2f(10.0f, -20.0f));
  EXPECT_EQ(field.At({105.1f, 3.0f}), Eigen::Vector2f(11.0f, -22.0f));
  // At the ends and beyond: of 0 to 4, of 15 to 19.
  EXPECT_EQ(field.At({-1e6f, 0.0f}), Eigen::Vector2f(2.0f, -4.0f));
  EXPECT_EQ(field.At({1e6f, 5.0f}), Eigen::Vector2f(17.0f, -34.0f));
}

// Against all distances, at pixels inside and outside of the field.
TEST(FlowField, FindsTheFiveNearestOfACloud) {
  RandomStream random(7);
  Anchors anchors;
  for (int i = 0; i < 301; ++i) {
    const auto number = static_cast<float>(i);
    anchors.push_back({{static_cast<float>(random.Uniform(0.0, 640.0)),
                        static_cast<float>(random.Uniform(0.0, 480.0))},
                       {number, -number}});
  }
  const FlowField field(anchors);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector2f pixel(static_cast<float>(random.Uniform(-200.0, 900.0)),
                                static_cast<float>(random.Uniform(-200.0, 700.0)));
    Anchors sorted = anchors;
    std::sort(sorted.begin(), sorted.end(), [&](const auto& a, const auto& b) {
      return (a.pixel - pixel).squaredNorm() < (b.pixel - pixel).squaredNorm();
    });
    std::array<float, 5> flows = {};
    for (size_t k = 0; k < 5; ++k) flows[k] = sorted[k].flow.x();
    std::sort(flows.begin(), flows.end());
    EXPECT_EQ(field.At(pixel), Eigen::Vector2f(flows[2], -flows[2])) << pixel.transpose();
  }
}

TEST(FlowField, MedianIsPerComponent) {
  Anchors anchors(12, {{1000.0f, 1000.0f}, {0.0f, 0.0f}});
  const float x[] = {1, 2, 3, 4, 5};
  const float y[] = {50, 10, 30, 20, 40};
  for (size_t i = 0; i < 5; ++i) anchors[i] = {{x[i], 0.0f}, {x[i], y[i]}};
  EXPECT_EQ(FlowField(anchors).At({3.0f, 0.0f}), Eigen::Vector2f(3.0f, 30.0f));
}

// Two of any five may be as wrong as they like.
TEST(FlowField, IgnoresOutliers) {
  Anchors anchors = Ramp(50);
  for (FlowField::Anchor& anchor : anchors) anchor.flow = {4.0f, 7.0f};
  for (size_t i = 0; i < anchors.size(); i += 3) anchors[i].flow = {1e6f, -1e6f};
  const FlowField field(anchors);
  for (float x = -20.0f; x < 520.0f; x += 3.7f) {
    EXPECT_EQ(field.At({x, 2.0f}), Eigen::Vector2f(4.0f, 7.0f)) << x;
  }
}

TEST(FlowField, NeedsTenAnchors) {
  for (const int count : {0, 1, 9}) {
    const FlowField field(Ramp(count));
    EXPECT_FALSE(field.IsUsable());
    EXPECT_TRUE(std::isinf(field.Radius()));
  }
  EXPECT_TRUE(FlowField(Ramp(10)).IsUsable());
  EXPECT_FALSE(std::isinf(FlowField(Ramp(10)).Radius()));
  EXPECT_EQ(FlowField({}).At({1.0f, 2.0f}), Eigen::Vector2f(0.0f, 0.0f));
  // Of fewer than five the median of those there are; of two the larger one.
  EXPECT_EQ(FlowField(Ramp(1)).At({1.0f, 2.0f}), Eigen::Vector2f(0.0f, 0.0f));
  EXPECT_EQ(FlowField(Ramp(2)).At({1.0f, 2.0f}), Eigen::Vector2f(1.0f, 0.0f));
  EXPECT_EQ(FlowField(Ramp(3)).At({1.0f, 2.0f}), Eigen::Vector2f(1.0f, -2.0f));
}

TEST(FlowField, RadiusIsZeroForAConstantField) {
  Anchors anchors = Ramp(30);
  for (FlowField::Anchor& anchor : anchors) anchor.flow = {-3.0f, 8.0f};
  EXPECT_EQ(FlowField(anchors).Radius(), 0.0f);
}

// Each anchor against the other ones, by hand: 0 is left with 1 to 5, whose median is 3; 1 with
// 0, 2, 3, 4, 5: 3; the inner ones i with i-2, i-1, i+1, i+2 and one of i-3 and i+3 at the same
// distance, of which the first wins: i-1. Deviations in units of |(1, -2)|: 3, 2, 1 for 2 (0, 1, 3,
// 4, 5: 3), then 1 each, and 2, 3 at the other end.
TEST(FlowField, RadiusIsThriceTheLeaveOneOutDeviation) {
  const FlowField field(Ramp(21));
  // Sorted 1 (17 times), 2, 2, 3, 3; 95 % of the way along 20 gaps is the 19th: 3.
  EXPECT_NEAR(field.Radius(), 3.0 * 3.0 * std::sqrt(5.0), 1e-4);
  // 41 anchors: the 38th of 40 gaps, the second of the twos.
  EXPECT_NEAR(FlowField(Ramp(41)).Radius(), 3.0 * 2.0 * std::sqrt(5.0), 1e-4);
}

// Among 41 of a constant field one stray leaves no trace, and its neighbours neither.
TEST(FlowField, RadiusForgivesOneOfTwentyAnchors) {
  Anchors anchors = Ramp(41);
  for (FlowField::Anchor& anchor : anchors) anchor.flow = {5.0f, 5.0f};
  anchors[17].flow = {500.0f, 5.0f};
  EXPECT_EQ(FlowField(anchors).Radius(), 0.0f);
  anchors[5].flow = anchors[29].flow = {5.0f, 105.0f};
  // Deviations 100, 100, 495 of 41; the 38th gap ends at the first 100.
  EXPECT_NEAR(FlowField(anchors).Radius(), 300.0f, 1e-3);
}

// The anchors of 10,000 that make the field are spread over all of them.
TEST(FlowField, SamplesManyAnchorsEvenly) {
  const Anchors anchors = Ramp(10000);
  const FlowField field(anchors);
  // 400 of them, every 25th: the field is within half the spacing of the truth, but for the ends.
  for (float x = 1000.0f; x < 98000.0f; x += 777.0f) {
    EXPECT_LE(std::abs(field.At({x, 0.0f}).x() - x / 10.0f), 12.6f);
  }
  EXPECT_EQ(field.At({0.0f, 0.0f}).x(), 50.0f);    // of 0, 25, 50, 75, 100
  EXPECT_EQ(field.At({1e6f, 0.0f}).x(), 9925.0f);  // of 9875, ..., 9975
  EXPECT_EQ(FlowField(Ramp(400)).At({1e6f, 0.0f}).x(), 397.0f);
  EXPECT_EQ(FlowField(Ramp(401)).At({1e6f, 0.0f}).x(), 397.0f);  // the last one is left out
}

// A smooth field, known with noise at a third of its places, wrong at a tenth: the radius holds the
// true vectors nearly everywhere and is not much larger than it need be.
TEST(FlowField, RadiusHoldsTrueVectors) {
  RandomStream random(9);
  const auto truth = [](const Eigen::Vector2f& pixel) {
    return Eigen::Vector2f(0.02f * pixel.x() + 3.0f, -0.01f * pixel.y() + 0.01f * pixel.x());
  };
  Anchors anchors;
  for (int i = 0; i < 300; ++i) {
    const double x = random.Uniform(0.0, 640.0);
    const double y = random.Uniform(0.0, 480.0);
    const Eigen::Vector2f pixel(static_cast<float>(x), static_cast<float>(y));
    anchors.push_back({pixel, truth(pixel) + 0.5f * random.NormalVector().head<2>().cast<float>()});
    if (i % 30 == 0) anchors.back().flow = {400.0f, 400.0f};
  }
  const FlowField field(anchors);
  EXPECT_LT(field.Radius(), 3.0f * 3.0f);  // three times about 2.45 sigma of a plane vector
  for (int i = 0; i < 1000; ++i) {
    const double x = random.Uniform(0.0, 640.0);
    const Eigen::Vector2f pixel(static_cast<float>(x),
                                static_cast<float>(random.Uniform(0.0, 480.0)));
    EXPECT_LT((field.At(pixel) - truth(pixel)).norm(), field.Radius());
  }
}

}  // namespace
}  // namespace vgtw
