// SPDX-License-Identifier: BSD-3-Clause
#include "matching/match_views.h"

#include "tests/matching/point_views.h"

#include <map>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::vector<ViewPair> AllPairs(size_t num_views) {
  std::vector<ViewPair> pairs;
  for (size_t i = 0; i < num_views; ++i) {
    for (size_t j = i + 1; j < num_views; ++j) {
      pairs.push_back({i, j, 1.0 / static_cast<double>(j - i), 10.0});
    }
  }
  return pairs;
}

// About its own centre.
void Turn(View& view, double angle_deg) {
  const Rigid3d turn = {RotationAboutAxis({0, 1, 0}, angle_deg), Eigen::Vector3d::Zero()};
  view.cam_from_world = turn * view.cam_from_world;
}

struct Outcome {
  std::vector<size_t> order;
  std::vector<MatchedPair> pairs;
  std::map<size_t, int> num_loads;
  int64_t last_done = 0;
};

Outcome Match(const std::vector<ViewFeatures>& views, int num_threads, int64_t max_memory) {
  MatchViewsOptions options;
  options.num_threads = num_threads;
  options.max_memory = max_memory;
  Outcome outcome;
  MatchViews(
      AllPairs(views.size()),
      views.size(),
      [&](size_t idx) {
        ++outcome.num_loads[idx];
        return views[idx];
      },
      [&](size_t pair_idx, MatchedPair pair) {
        outcome.order.push_back(pair_idx);
        outcome.pairs.push_back(std::move(pair));
      },
      options,
      [&](int64_t done, int64_t total) {
        EXPECT_EQ(total, static_cast<int64_t>(AllPairs(views.size()).size()));
        EXPECT_GT(done, outcome.last_done);
        outcome.last_done = done;
      });
  return outcome;
}

TEST(MatchViews, EveryPairIsMatchedAndHandedOverInOrder) {
  const std::vector<ViewFeatures> views = MakePointViews(5, 120);
  const Outcome outcome = Match(views, 2, int64_t{1} << 30);
  EXPECT_THAT(outcome.order, testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_EQ(outcome.last_done, 10);
  for (const auto& [idx, num] : outcome.num_loads) EXPECT_EQ(num, 1) << idx;
  for (const MatchedPair& pair : outcome.pairs) {
    EXPECT_EQ(pair.method, MatchMethod::kGuided);
    // Keypoint i is point i in every view.
    EXPECT_EQ(pair.geometry.inlier_matches.size(), 120u);
    for (const auto& [idx1, idx2] : pair.geometry.inlier_matches) EXPECT_EQ(idx1, idx2);
  }
}

TEST(MatchViews, NeitherThreadsNorMemoryChangeTheResult) {
  std::vector<ViewFeatures> views = MakePointViews(5, 120);
  Turn(views[2].view, 6.0);
  const Outcome reference = Match(views, 1, int64_t{1} << 30);
  const Outcome other = Match(views, 3, 1);
  EXPECT_GT(other.num_loads.at(0), 1);
  EXPECT_EQ(other.order, reference.order);
  for (size_t i = 0; i < reference.pairs.size(); ++i) {
    EXPECT_EQ(other.pairs[i].geometry.inlier_matches, reference.pairs[i].geometry.inlier_matches);
    EXPECT_EQ(other.pairs[i].geometry.E, reference.pairs[i].geometry.E);
    EXPECT_EQ(other.pairs[i].num_widenings, reference.pairs[i].num_widenings);
  }
}

TEST(MatchViews, PairsOfAWrongViewAreFoundInWiderWindows) {
  std::vector<ViewFeatures> views = MakePointViews(5, 120);
  // 61 pixels; windows of two sigma (1 degree, 3 % of the focal length) reach about 40.
  Turn(views[2].view, 7.0);
  const Outcome outcome = Match(views, 1, int64_t{1} << 30);
  const std::vector<ViewPair> pairs = AllPairs(views.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    const bool is_wrong = pairs[i].view_idx1 == 2 || pairs[i].view_idx2 == 2;
    EXPECT_EQ(outcome.pairs[i].num_widenings > 0, is_wrong) << i;
    EXPECT_EQ(outcome.pairs[i].geometry.inlier_matches.size(), 120u) << i;
    ASSERT_TRUE(outcome.pairs[i].prediction_error);
    // Pixels are floats of 640 px: their rounding turns nothing by a thousandth of a degree.
    EXPECT_NEAR(outcome.pairs[i].prediction_error->rotation_deg, is_wrong ? 7.0 : 0.0, 1e-3);
  }
}

TEST(MatchViews, FailuresEndIt) {
  const auto fail = [](size_t) -> ViewFeatures { throw std::runtime_error("gone"); };
  const auto take = [](size_t, const MatchedPair&) {};
  EXPECT_THROW(MatchViews(AllPairs(3), 3, fail, take, {}), std::runtime_error);
  EXPECT_THROW(MatchViews(AllPairs(3), 2, fail, take, {}), std::invalid_argument);
  MatchViews({}, 0, fail, take, {});
}

}  // namespace
}  // namespace vgtw
