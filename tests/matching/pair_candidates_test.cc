// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_candidates.h"

#include "scene/synthetic.h"
#include "tests/support/wall_prediction.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::vector<ViewSketch> SketchAll(const Prediction& prediction) {
  std::vector<ViewSketch> sketches;
  for (const ViewPrediction& view : prediction.views) {
    sketches.push_back(MakeViewSketch(StaticView(view, 0.5), 0.0));
  }
  return sketches;
}

std::vector<ViewSketch> SketchWallFrom(const std::vector<double>& xs) {
  Prediction prediction;
  for (const double x : xs) prediction.views.push_back(MakeWallView("a.png", x));
  return SketchAll(prediction);
}

TEST(PairCandidates, TheLikestComeFirst) {
  // The image is 64 / 61.2 * 5.1 = 5.33 wide at the wall: the last view is four times that away.
  const std::vector<ViewSketch> sketches = SketchWallFrom({0.0, 3.5, 0.4, -2.0, 21.0});
  const Covisibility covisibility(sketches, {});
  const PairCandidates candidates(covisibility);
  EXPECT_EQ(candidates.Of(0), (std::vector<size_t>{2, 3, 1}));
  EXPECT_TRUE(candidates.Of(4).empty());
}

TEST(PairCandidates, AreMutual) {
  const std::vector<ViewSketch> sketches = SketchAll(
      MakeTruePrediction(SyntheticScene({.num_views = 12, .path_extent_deg = 360.0}), 70));
  const Covisibility covisibility(sketches, {});
  const PairCandidates candidates(covisibility);
  for (size_t i = 0; i < sketches.size(); ++i) {
    for (const size_t j : candidates.Of(i)) {
      const std::vector<size_t> back = candidates.Of(j);
      EXPECT_NE(std::find(back.begin(), back.end(), i), back.end()) << i << " " << j;
    }
  }
}

TEST(PairCandidates, MissNoPairThatSharesMuch) {
  for (const CameraPath path : {CameraPath::kOrbit, CameraPath::kForward, CameraPath::kGrid}) {
    const SyntheticScene scene({.path = path, .num_views = 20, .path_extent_deg = 360.0});
    const std::vector<ViewSketch> sketches = SketchAll(MakeTruePrediction(scene, 70));
    const Covisibility covisibility(sketches, {});
    const PairCandidates candidates(covisibility);
    for (size_t i = 0; i < sketches.size(); ++i) {
      const std::vector<size_t> found = candidates.Of(i);
      for (size_t j = 0; j < sketches.size(); ++j) {
        const auto pair = i == j ? std::nullopt : covisibility.Measure(i, j);
        if (!pair || pair->covisibility < 0.05) continue;
        EXPECT_NE(std::find(found.begin(), found.end(), j), found.end())
            << i << " " << j << " share " << pair->covisibility;
      }
    }
  }
}

TEST(PairCandidates, WhereEverybodySeesEverythingNeighboursInTheListComeFirst) {
  // Each views' points fill one voxel that all share, of which the list is cut.
  const std::vector<ViewSketch> sketches(5000, [] {
    ViewSketch sketch;
    sketch.view = MakeWallView("a.png", 0.0).view;
    sketch.points = {{0.0, 0.0, kWallDepth}};
    return sketch;
  }());
  const Covisibility covisibility(sketches, {});
  const PairCandidates candidates(covisibility);
  const std::vector<size_t> found = candidates.Of(2500);
  EXPECT_LE(found.size(), PairCandidates::kMaxViewsPerVoxel);
  EXPECT_GE(found.size(), PairCandidates::kMaxViewsPerVoxel / 2);
  for (const size_t neighbour : {2400u, 2499u, 2501u, 2600u}) {
    EXPECT_NE(std::find(found.begin(), found.end(), neighbour), found.end()) << neighbour;
  }
  EXPECT_LT(*std::min_element(found.begin(), found.end()), 20u);
  EXPECT_GT(*std::max_element(found.begin(), found.end()), 4980u);
}

TEST(PairCandidates, FaultyViewsAndPointsHaveNone) {
  std::vector<ViewSketch> sketches = SketchWallFrom({0.0, 0.1, 0.2});
  sketches[1].view.cam_from_world.rotation.x() = std::numeric_limits<double>::quiet_NaN();
  sketches[0].points[0] = {std::numeric_limits<double>::infinity(), 0.0, 1.0};
  sketches[0].points[1] = {1e300, 1e300, 1e300};
  const Covisibility covisibility(sketches, {});
  const PairCandidates candidates(covisibility);
  EXPECT_EQ(candidates.Of(0), (std::vector<size_t>{2}));
  EXPECT_TRUE(candidates.Of(1).empty());
}

}  // namespace
}  // namespace vgtw
