// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/training_curves.h"

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

size_t Count(const std::string& text, const std::string& part) {
  size_t num = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++num;
  return num;
}

// Pixels of the polyline of the panel with this title.
std::vector<double> HeightsOf(const std::string& svg, const std::string& title) {
  const std::string begin = "<polyline points=\"";
  const size_t at = svg.find(begin, svg.find(">" + title + "<")) + begin.size();
  std::istringstream points(svg.substr(at, svg.find('"', at) - at));
  std::vector<double> heights;
  double x = 0.0, y = 0.0;
  for (char comma = 0; points >> x >> comma >> y;) heights.push_back(y);
  return heights;
}

TrainingLog LogOfLosses(const std::vector<double>& losses) {
  TrainingLog log;
  for (size_t i = 0; i < losses.size(); ++i) {
    TrainingStep& step = log.steps.emplace_back();
    step.step = static_cast<int64_t>(i);
    step.loss = losses[i];
  }
  return log;
}

TEST(TrainingCurves, ShowWhatWasComputedAlone) {
  TrainingLog log = LogOfLosses({3.0, 2.0});
  log.steps[1].losses[1] = 0.5;
  log.validations.emplace_back().rotation_deg = 4.0;
  const std::string svg = DrawTrainingCurves(log);
  EXPECT_EQ(Count(svg, "<polyline"), 3u);
  EXPECT_NE(svg.find(">suppression loss<"), std::string::npos);
  EXPECT_NE(svg.find(">held out: rotation (deg)<"), std::string::npos);
  EXPECT_EQ(svg.find(">depth loss<"), std::string::npos);
  EXPECT_TRUE(DrawTrainingCurves({}).empty());
}

TEST(TrainingCurves, AreHigherWhereValuesAre) {
  const std::string title = "loss, weighted sum";
  const auto linear = HeightsOf(DrawTrainingCurves(LogOfLosses({1.0, 2.0, 3.0})), title);
  ASSERT_EQ(linear.size(), 3u);
  EXPECT_GT(linear[0], linear[2]);
  EXPECT_NEAR(linear[1], 0.5 * (linear[0] + linear[2]), 0.11);
  const auto by_factors = HeightsOf(DrawTrainingCurves(LogOfLosses({1.0, 10.0, 100.0})), title);
  EXPECT_NEAR(by_factors[1], 0.5 * (by_factors[0] + by_factors[2]), 0.11);
  const auto with_zero = HeightsOf(DrawTrainingCurves(LogOfLosses({0.0, 50.0, 100.0})), title);
  EXPECT_NEAR(with_zero[1], 0.5 * (with_zero[0] + with_zero[2]), 0.11);
}

TEST(TrainingCurves, OfLongRunsAreMeansOfNeighbours) {
  std::vector<double> losses;
  for (int i = 0; i < 10'000; ++i) losses.push_back(i % 2 == 0 ? 1.0 : 3.0);
  const auto heights = HeightsOf(DrawTrainingCurves(LogOfLosses(losses)), "loss, weighted sum");
  EXPECT_LE(heights.size(), 300u);
  EXPECT_EQ(*std::min_element(heights.begin(), heights.end()),
            *std::max_element(heights.begin(), heights.end()));
}

}  // namespace
}  // namespace vgtw
