// SPDX-License-Identifier: BSD-3-Clause
#include "scene/mask_vote.h"

#include "scene/perturb.h"
#include "scene/synthetic.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kWall = 5.0f;
constexpr float kMover = 2.0f;

// 40 x 30 pixels, f = 20, at (x, 0, 0), looking along z at a wall at z = 5: moving by 0.25 shifts
// the wall by exactly one pixel.
ViewPrediction WallView(double x) {
  ViewPrediction prediction;
  prediction.view.camera = MakePinhole(40, 30, 20.0, 20.0);
  prediction.view.cam_from_world.translation = {-x, 0.0, 0.0};
  prediction.view.network_width = 40;
  prediction.view.network_height = 30;
  prediction.depth = DepthMap(40, 30, kWall);
  prediction.distractor = DistractorMask(40, 30, 0.0f);
  return prediction;
}

struct Box {
  int left = 12;
  int top = 8;
  int right = 28;  // exclusive
  int bottom = 22;
};

void Fill(Grid<float>& map, const Box& box, float value) {
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) map(x, y) = value;
  }
}

// One vote per view counts, and windows do not smear.
MaskVoteOptions PlainOptions() {
  return {.position_error_px = 0, .min_consistent = 2, .min_see_through = 2, .window_px = 1};
}

Votes VotesOn(const ViewPrediction& view,
              const std::vector<ViewPrediction>& others,
              const MaskVoteOptions& options = PlainOptions()) {
  std::vector<VoteView> voters;
  for (const ViewPrediction& other : others) voters.emplace_back(other, options);
  std::vector<const VoteView*> pointers;
  for (const VoteView& voter : voters) pointers.push_back(&voter);
  return CountVotes(VoteView(view, options), pointers, options);
}

TEST(MaskVote, ViewsOfTheSameSurfaceAgreeWhereTheyOverlap) {
  const Votes votes = VotesOn(WallView(0.0), {WallView(0.5), WallView(-0.75)});
  // The wall's pixel 10 is pixel 10 - 2 from 0.5 on the right and 10 + 3 from 0.75 on the left;
  // the first two columns are out of sight of the former, the last three of the latter.
  for (int x = 0; x < 40; ++x) {
    EXPECT_EQ(votes.num_consistent(x, 7), (x >= 2 ? 1 : 0) + (x < 37 ? 1 : 0)) << x;
    EXPECT_EQ(votes.num_see_through(x, 7), 0) << x;
  }
}

TEST(MaskVote, ViewsWithoutTheMoverLookThroughIt) {
  ViewPrediction view = WallView(0.0);
  Fill(view.depth, {}, kMover);
  const Votes votes = VotesOn(view, {WallView(0.2), WallView(-0.2)});
  // At depth 2 a step of 0.2 is 2 px, so that both see the whole mover's place; r = (5 - 2) / 2.
  EXPECT_EQ(votes.num_see_through(20, 15), 2);
  EXPECT_EQ(votes.num_consistent(20, 15), 0);
  // 3x3 neighbours of both depths: no vote on either side of the edge.
  for (const int x : {11, 12}) {
    EXPECT_EQ(votes.num_see_through(x, 15) + votes.num_consistent(x, 15), 0) << x;
  }
  EXPECT_EQ(votes.num_see_through(13, 15), 2);
  EXPECT_EQ(votes.num_consistent(10, 15), 2);
}

TEST(MaskVote, WhatAnotherViewsMoverHidesGetsNoVote) {
  ViewPrediction other = WallView(0.0);
  Fill(other.depth, {}, kMover);
  const Votes votes = VotesOn(WallView(0.0), {other});
  EXPECT_EQ(votes.num_consistent(20, 15) + votes.num_see_through(20, 15), 0);
  EXPECT_EQ(votes.num_consistent(5, 15), 1);
}

TEST(MaskVote, TheToleranceIsRelativeToTheExpectedDepth) {
  const MaskVoteOptions options = PlainOptions();
  for (const auto& [depth, consistent, see_through] :
       {std::tuple(5.24f, 1, 0), {5.26f, 0, 1}, {4.76f, 1, 0}, {4.74f, 0, 0}}) {
    ViewPrediction other = WallView(0.0);
    // Only a part, so that the noise estimate stays at 0.
    Fill(other.depth, {}, depth);
    const Votes votes = VotesOn(WallView(0.0), {other}, options);
    EXPECT_EQ(votes.num_consistent(20, 15), consistent) << depth;
    EXPECT_EQ(votes.num_see_through(20, 15), see_through) << depth;
  }
}

TEST(MaskVote, TheToleranceGrowsWithTheNoiseThatStaticPixelsShow) {
  ViewPrediction other = WallView(0.0);
  for (float& depth : other.depth.data()) depth *= 1.02f;
  Fill(other.depth, {}, 1.07f * kWall);
  // Median |r| 0.02: sigma 0.0297; two of them are less than 0.07, three are more.
  MaskVoteOptions options = PlainOptions();
  options.noise_factor = 3.0;
  EXPECT_EQ(VotesOn(WallView(0.0), {other}, options).num_consistent(20, 15), 1);
  options.noise_factor = 2.0;
  EXPECT_EQ(VotesOn(WallView(0.0), {other}, options).num_see_through(20, 15), 1);
}

TEST(MaskVote, ViewsMustLookThroughEverywhereWithinThePositionError) {
  ViewPrediction view = WallView(0.0);
  Fill(view.depth, {}, kMover);
  ViewPrediction other = WallView(0.0);
  other.depth(23, 15) = kMover;  // three pixels to the right of (20, 15)
  MaskVoteOptions options = PlainOptions();
  options.position_error_px = 2;
  EXPECT_EQ(VotesOn(view, {other}, options).num_see_through(20, 15), 1);
  options.position_error_px = 3;
  EXPECT_EQ(VotesOn(view, {other}, options).num_see_through(20, 15), 0);
}

TEST(MaskVote, MaskedPixelsDoNotConfirmButAreLookedThrough) {
  ViewPrediction masked = WallView(0.0);
  Fill(masked.distractor, {0, 0, 40, 30}, 0.5f);
  EXPECT_EQ(VotesOn(WallView(0.0), {masked}).num_consistent(20, 15), 0);
  ViewPrediction unknown = WallView(0.0);
  Fill(unknown.distractor, {0, 0, 40, 30}, kNaN);
  EXPECT_EQ(VotesOn(WallView(0.0), {unknown}).num_consistent(20, 15), 0);
  ViewPrediction view = WallView(0.0);
  Fill(view.depth, {}, kMover);
  EXPECT_EQ(VotesOn(view, {masked}).num_see_through(20, 15), 1);
}

TEST(MaskVote, UnknownDepthNeitherVotesNorIsVotedOn) {
  for (const float unknown : {kNaN, 0.0f, -1.0f, std::numeric_limits<float>::infinity()}) {
    ViewPrediction hole = WallView(0.0);
    Fill(hole.depth, {}, unknown);
    for (const Votes& votes : {VotesOn(WallView(0.0), {hole}), VotesOn(hole, {WallView(0.0)})}) {
      EXPECT_EQ(votes.num_consistent(20, 15) + votes.num_see_through(20, 15), 0) << unknown;
      EXPECT_EQ(votes.num_consistent(5, 15), 1) << unknown;
    }
  }
}

TEST(MaskVote, PointsStandInForDepth) {
  ViewPrediction view = WallView(0.5);
  view.points = Grid<Eigen::Vector3f>(40, 30, Eigen::Vector3f(0.0f, 0.0f, kMover));
  view.depth = {};
  // The camera looks along z, so z in the world is the depth.
  EXPECT_EQ(VoteView(view, PlainOptions()).depth(), DepthMap(40, 30, kMover));
  view.points = {};
  const Votes votes = VotesOn(view, {WallView(0.0)});
  EXPECT_EQ(votes.num_consistent, Grid<uint16_t>(40, 30));
}

TEST(MaskVote, PixelsOutsideOfAStrideHaveNoVotes) {
  const MaskVoteOptions options = PlainOptions();
  const VoteView view(WallView(0.0), options);
  const Votes votes = CountVotes(view, {&view}, options, 1, 4);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      EXPECT_EQ(votes.num_consistent(x, y), x % 4 == 0 && y % 4 == 0 ? 1 : 0);
    }
  }
}

TEST(MaskVote, JudgesByNumbersOfVotes) {
  MaskVoteOptions options = {
      .min_consistent = 3, .max_see_through_share = 0.25, .min_see_through = 2};
  EXPECT_EQ(Judge(2, 0, options), Verdict::kNone);
  EXPECT_EQ(Judge(3, 0, options), Verdict::kStatic);
  EXPECT_EQ(Judge(3, 1, options), Verdict::kStatic);  // 1 of 4
  EXPECT_EQ(Judge(5, 2, options), Verdict::kNone);    // 2 of 7
  EXPECT_EQ(Judge(0, 1, options), Verdict::kNone);
  EXPECT_EQ(Judge(0, 2, options), Verdict::kDistractor);
  EXPECT_EQ(Judge(2, 2, options), Verdict::kNone);  // not outnumbered
  EXPECT_EQ(Judge(2, 3, options), Verdict::kDistractor);
}

TEST(MaskVote, ReleasesAndAddsByTheMajorityOfTheWindow) {
  MaskVoteOptions options = PlainOptions();
  options.window_px = 3;
  Votes votes = {Grid<uint16_t>(9, 5), Grid<uint16_t>(9, 5)};
  // A square of static verdicts with a hole, and a speck of see-through ones.
  for (int y = 1; y < 4; ++y) {
    for (int x = 1; x < 4; ++x) votes.num_consistent(x, y) = x == 2 && y == 2 ? 0 : 2;
  }
  votes.num_see_through(7, 2) = 2;
  DistractorMask distractor(9, 5, 1.0f);
  for (int y = 0; y < 5; ++y) distractor(7, y) = 0.25f;
  const DistractorMask before = distractor;
  const MaskChanges changes = ApplyVotes(votes, options, true, distractor);
  // Of the squares around (1..3, 2) and (2, 1..3) 5 or 8 of 9 are static, around the corners 3.
  EXPECT_EQ(changes.num_released, 5u);
  EXPECT_EQ(changes.num_added, 0u);
  EXPECT_EQ(distractor(2, 2), 0.0f);
  EXPECT_EQ(distractor(1, 1), 1.0f);
  EXPECT_EQ(distractor(7, 2), 0.25f);
  distractor = before;
  ApplyVotes(votes, options, false, distractor);
  EXPECT_EQ(distractor, before);
}

TEST(MaskVote, MakesAMaskFromNothingAndLeavesTheUnknown) {
  Votes votes = {Grid<uint16_t>(3, 1), Grid<uint16_t>(3, 1)};
  votes.num_see_through(0, 0) = 2;
  DistractorMask none;
  EXPECT_EQ(ApplyVotes(votes, PlainOptions(), true, none).num_added, 1u);
  EXPECT_EQ(none.data(), (std::vector<float>{1.0f, 0.0f, 0.0f}));
  DistractorMask unknown(3, 1, kNaN);
  ApplyVotes(votes, PlainOptions(), true, unknown);
  EXPECT_EQ(unknown(0, 0), 1.0f);
  EXPECT_TRUE(std::isnan(unknown(1, 0)));
  DistractorMask wrong_size(2, 1);
  EXPECT_THROW(ApplyVotes(votes, PlainOptions(), true, wrong_size), std::invalid_argument);
}

TEST(MaskVote, ReleasesNothingWhereDepthDoesNotFollowTheMasks) {
  const MaskVoteOptions options = {.min_see_through_masked_share = 0.25};
  EXPECT_TRUE(MayRelease({.num_static = 75, .num_distractor = 25}, options));
  EXPECT_FALSE(MayRelease({.num_static = 76, .num_distractor = 24}, options));
}

TEST(SelectVoters, TakesTheNearestByPlaceAndDirection) {
  std::vector<View> views(5);
  const auto place = [&](size_t idx, double x, double turn_deg) {
    Rigid3d& cam_from_world = views[idx].cam_from_world;
    cam_from_world.rotation = RotationAboutAxis(Eigen::Vector3d::UnitY(), turn_deg);
    cam_from_world.translation = -(cam_from_world.rotation * Eigen::Vector3d(x, 0.0, 0.0));
  };
  place(0, 0.0, 0.0);
  place(1, 4.0, 0.0);    // 4 / depth
  place(2, 0.0, 90.0);   // pi / 2
  place(3, 1.0, 0.0);    // 1 / depth
  place(4, 0.0, 180.0);  // pi
  EXPECT_EQ(SelectVoters(views, 0, 4.0, 2), (std::vector<size_t>{1, 3}));
  EXPECT_EQ(SelectVoters(views, 0, 2.0, 2), (std::vector<size_t>{2, 3}));
  EXPECT_EQ(SelectVoters(views, 0, 2.0, 9), (std::vector<size_t>{1, 2, 3, 4}));
}

TEST(SelectVoters, ViewsFarAwayDoNotMatter) {
  std::vector<View> views(4);
  for (size_t i = 0; i < 4; ++i) views[i].cam_from_world.translation.x() = static_cast<double>(i);
  const std::vector<size_t> voters = SelectVoters(views, 1, 1.0, 3);
  views.emplace_back().cam_from_world.translation.z() = 1e6;
  EXPECT_EQ(SelectVoters(views, 1, 1.0, 3), voters);
}

TEST(MaskVoteOptions, NamesWhatIsOutOfBounds) {
  MaskVoteOptions options;
  options.window_px = 4;
  try {
    options.Check();
    FAIL() << "an even window was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("window_px = 4"), std::string::npos);
  }
  for (const MaskVoteOptions& absurd : {MaskVoteOptions{.distractor_threshold = kNaN},
                                        {.max_relative_depth_difference = 0.0},
                                        {.noise_factor = -1.0},
                                        {.max_relative_step = 0.0},
                                        {.position_error_px = -1},
                                        {.min_consistent = 0},
                                        {.max_see_through_share = 1.0},
                                        {.min_see_through = 0},
                                        {.min_see_through_masked_share = 2.0},
                                        {.max_views = 0}}) {
    EXPECT_THROW(absurd.Check(), std::invalid_argument);
  }
}

// The synthetic scene with its true depths, movers included.
Prediction RenderScene(int num_distractors) {
  const SyntheticScene scene(
      {.num_views = 8, .width = 160, .height = 120, .num_distractors = num_distractors});
  Prediction prediction;
  for (size_t i = 0; i < scene.views().size(); ++i) {
    SyntheticView rendered = scene.Render(i);
    ViewPrediction& view = prediction.views.emplace_back();
    view.view = scene.views()[i];
    view.depth = std::move(rendered.depth);
    view.distractor = std::move(rendered.distractor);
  }
  return prediction;
}

std::vector<Votes> VotesOnAll(const Prediction& prediction, const MaskVoteOptions& options) {
  std::vector<Votes> votes;
  for (size_t i = 0; i < prediction.views.size(); ++i) {
    std::vector<ViewPrediction> others = prediction.views;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    votes.push_back(VotesOn(prediction.views[i], others, options));
  }
  return votes;
}

TEST(MaskVote, AStaticSceneStaysAsItIsWithNoiseBelowTheTolerance) {
  const PerturbOptions noise = {.rotation_deg = 0.0,
                                .centre_percent = 0.0,
                                .focal_percent = 0.0,
                                .depth_scale_percent = 0.5,
                                .depth_noise_percent = 0.5};
  const Prediction prediction = Perturb(RenderScene(0), noise);
  for (const Votes& votes : VotesOnAll(prediction, {})) {
    DistractorMask distractor;
    EXPECT_EQ(ApplyVotes(votes, {}, true, distractor).num_added, 0u);
  }
}

TEST(MaskVote, WithExactDepthsNothingStaticIsAddedAndOnlyContactsAreReleased) {
  const Prediction prediction = RenderScene(4);
  // A larger window rounds outlines.
  const MaskVoteOptions options = {.window_px = 1};
  const std::vector<Votes> all_votes = VotesOnAll(prediction, options);
  uint64_t num_masked = 0;
  uint64_t num_released = 0;
  for (size_t i = 0; i < prediction.views.size(); ++i) {
    DistractorMask distractor = prediction.views[i].distractor;
    num_masked +=
        static_cast<uint64_t>(std::count(distractor.data().begin(), distractor.data().end(), 1.0f));
    const MaskChanges changes = ApplyVotes(all_votes[i], options, true, distractor);
    EXPECT_EQ(changes.num_added, 0u) << i;
    num_released += changes.num_released;
  }
  ASSERT_GT(num_masked, 10000u);
  // Feet and wheels within the tolerance of the ground's depth.
  EXPECT_LT(num_released, num_masked / 20);
}

TEST(MaskVote, AMoverThatStandsStillKeepsTrueMasksButIsNotFoundWithoutThem) {
  ViewPrediction view = WallView(0.0);
  Fill(view.depth, {}, kMover);
  std::vector<ViewPrediction> others = {view, view};
  DistractorMask distractor;
  EXPECT_EQ(ApplyVotes(VotesOn(view, others), PlainOptions(), true, distractor).num_added, 0u);
  for (ViewPrediction& other : others) Fill(other.distractor, {}, 1.0f);
  distractor = others[0].distractor;
  EXPECT_EQ(ApplyVotes(VotesOn(view, others), PlainOptions(), true, distractor).num_released, 0u);
}

TEST(MaskVote, TheOrderOfViewsDoesNotMatter) {
  const Prediction prediction = RenderScene(3);
  std::vector<ViewPrediction> others(prediction.views.begin() + 1, prediction.views.end());
  const Votes votes = VotesOn(prediction.views[0], others);
  std::reverse(others.begin(), others.end());
  const Votes reversed = VotesOn(prediction.views[0], others);
  EXPECT_EQ(votes.num_consistent, reversed.num_consistent);
  EXPECT_EQ(votes.num_see_through, reversed.num_see_through);
}

}  // namespace
}  // namespace vgtw
