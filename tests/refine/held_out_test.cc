// SPDX-License-Identifier: BSD-3-Clause
#include "refine/held_out.h"

#include "scene/sim3d.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::vector<Track> NumberedTracks(size_t num) {
  std::vector<Track> tracks;
  for (uint32_t i = 0; i < num; ++i) tracks.push_back({{1 + i % 7, i}, {8 + i % 5, i}});
  return tracks;
}

Rigid3d Turned(const Rigid3d& cam_from_world, double angle_deg) {
  const Eigen::Quaterniond turn = RotationAboutAxis({0.0, 1.0, 0.0}, angle_deg);
  return {turn * cam_from_world.rotation, turn * cam_from_world.translation};
}

TEST(HoldOutTracks, SplitsIntoBothSidesInOrder) {
  const std::vector<Track> tracks = NumberedTracks(1000);
  const SplitTracks split = HoldOutTracks(tracks, 25.0, 3);
  std::vector<Track> merged;
  const auto by_keypoint = [](const Track& a, const Track& b) {
    return a.front().point2D_idx < b.front().point2D_idx;
  };
  std::merge(split.adjusted.begin(),
             split.adjusted.end(),
             split.held_out.begin(),
             split.held_out.end(),
             std::back_inserter(merged),
             by_keypoint);
  EXPECT_EQ(merged, tracks);
  EXPECT_EQ(HoldOutTracks({{}}, 50.0, 0).adjusted.size(), 0u);
  EXPECT_EQ(HoldOutTracks({{}}, 50.0, 0).held_out.size(), 0u);
}

TEST(HoldOutTracks, HoldsOutTheShareThatIsAskedFor) {
  const std::vector<Track> tracks = NumberedTracks(20000);
  EXPECT_TRUE(HoldOutTracks(tracks, 0.0, 0).held_out.empty());
  for (const double percent : {1.0, 10.0, 50.0, 99.0}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      const double share = percent / 100.0;
      const double sigma = std::sqrt(20000.0 * share * (1.0 - share));
      // 20 draws: one beyond 4 sigma would come up once in 800 choices of these seeds.
      EXPECT_NEAR(static_cast<double>(HoldOutTracks(tracks, percent, seed).held_out.size()),
                  20000.0 * share,
                  4.0 * sigma);
    }
  }
  for (const double percent : {-1.0, 100.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(HoldOutTracks(tracks, percent, 0), std::invalid_argument);
  }
}

TEST(HoldOutTracks, SeedsChooseIndependently) {
  const std::vector<Track> tracks = NumberedTracks(20000);
  const std::vector<Track> a = HoldOutTracks(tracks, 10.0, 1).held_out;
  EXPECT_EQ(a, HoldOutTracks(tracks, 10.0, 1).held_out);
  for (const uint64_t seed : {0, 2, 3, 1000}) {
    const std::vector<Track> b = HoldOutTracks(tracks, 10.0, seed).held_out;
    const auto num_common = std::count_if(a.begin(), a.end(), [&](const Track& track) {
      return std::find(b.begin(), b.end(), track) != b.end();
    });
    // 200 +- 14 of 20000 by chance.
    EXPECT_NEAR(static_cast<double>(num_common), 200.0, 56.0) << seed;
  }
}

TEST(HoldOutTracks, ATrackStaysOnItsSide) {
  const std::vector<Track> tracks = NumberedTracks(2000);
  const SplitTracks split = HoldOutTracks(tracks, 20.0, 1);
  std::vector<Track> changed;
  for (size_t i = 0; i < tracks.size(); i += 3) {
    Track& longer = changed.emplace_back(tracks[i]);
    longer.push_back({20, 5});
  }
  std::reverse(changed.begin(), changed.end());
  for (Track track : HoldOutTracks(changed, 20.0, 1).held_out) {
    track.pop_back();
    EXPECT_NE(std::find(split.held_out.begin(), split.held_out.end(), track), split.held_out.end());
  }
  for (Track track : HoldOutTracks(changed, 20.0, 1).adjusted) {
    track.pop_back();
    EXPECT_NE(std::find(split.adjusted.begin(), split.adjusted.end(), track), split.adjusted.end());
  }
}

TEST(HeldOutJudge, MeansByHand) {
  const HeldOutJudge judge({{{1, 0}, {2, 0}}, {{1, 1}, {3, 1}}}, 2.0, 100.0, 1);
  const HeldOutJudge::Errors errors = {0.0, 2.0, 4.0, 6.0};
  // Losses log(1), log(2), log(5), log(10): their mean is log(100) / 4 = log(sqrt(10)).
  EXPECT_NEAR(judge.MeanPx(errors), 2.0 * std::sqrt(std::sqrt(10.0) - 1.0), 1e-12);
  const auto by_image = judge.MeanPxByImage(errors);
  ASSERT_EQ(by_image.size(), 3u);
  EXPECT_NEAR(by_image.at(1), 2.0 * std::sqrt(std::sqrt(5.0) - 1.0), 1e-12);
  EXPECT_NEAR(by_image.at(2), 2.0, 1e-12);
  EXPECT_NEAR(by_image.at(3), 6.0, 1e-12);
  EXPECT_EQ(judge.NumObservations(), (std::map<ImageId, size_t>{{1, 2}, {2, 1}, {3, 1}}));
  EXPECT_EQ(judge.NumObservations(/*min_track_length=*/3), (std::map<ImageId, size_t>{}));
  // Equal errors are their own mean.
  EXPECT_NEAR(judge.MeanPx({7.0, 7.0, 7.0, 7.0}), 7.0, 1e-12);
}

TEST(HeldOutJudge, FindsWorseImagesByHand) {
  const HeldOutJudge judge({{{1, 0}, {2, 0}}, {{1, 1}, {2, 1}}, {{1, 2}, {2, 2}}}, 1.0, 100.0, 1);
  // Errors e with log(1 + e^2) = 1, 2, 3.
  const auto with_loss = [](double loss) { return std::sqrt(std::expm1(loss)); };
  const HeldOutJudge::Errors before(6, 0.0);
  // Image 1: differences 1, 2, 3, mean 2, standard error sqrt(2/3 / 2) = 0.577: 3.46 sigmas.
  const HeldOutJudge::Errors after = {with_loss(1), 0.0, with_loss(2), 0.0, with_loss(3), 0.0};
  EXPECT_EQ(judge.FindWorse(before, after, 3.4), std::vector<ImageId>{1});
  EXPECT_EQ(judge.FindWorse(before, after, 3.5), std::vector<ImageId>{});
  EXPECT_EQ(judge.FindWorse(after, before, 0.0), std::vector<ImageId>{});
  // Both images: differences 1, 0, 2, 0, 3, 0, mean 1, standard error sqrt(8/6 / 5) = 0.516.
  EXPECT_TRUE(judge.IsWorse(before, after, 1.9));
  EXPECT_FALSE(judge.IsWorse(before, after, 2.0));
  EXPECT_FALSE(judge.IsWorse(after, before, 0.0));
  EXPECT_EQ(judge.FindWorse(after, after, 0.0), std::vector<ImageId>{});
}

TEST(HeldOutJudge, ErrorsAreZeroAtTheTruthAndGrowWithThePoses) {
  const Reconstruction truth = MakeSyntheticModel({});
  const HeldOutJudge judge(TracksOf(truth), 1.0, 500.0, 2);
  const HeldOutJudge::Errors errors = judge.Measure(truth);
  ASSERT_EQ(errors.size(), 720u);
  EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 1e-6);
  double before_px = judge.MeanPx(errors);
  for (const double rotation_deg : {0.01, 0.1, 1.0, 5.0}) {
    Reconstruction model = truth;
    PerturbPoses(model, rotation_deg, 0.0, 1);
    const double mean_px = judge.MeanPx(judge.Measure(model));
    EXPECT_GT(mean_px, 3.0 * before_px);
    before_px = mean_px;
  }
}

TEST(HeldOutJudge, ErrorsDoNotDependOnPointsWorldOrThreads) {
  Reconstruction model = MakeSyntheticModel({});
  ProjectAgain(model, 1.0, 2);
  const std::vector<Track> tracks = TracksOf(model);
  const HeldOutJudge judge(tracks, 1.0, 50.0, 1);
  const double mean_px = judge.MeanPx(judge.Measure(model));
  // Noise of 1 px per coordinate in 6 images, less the 3 of 12 coordinates that the point takes:
  // the mean of log(1 + e^2) for that Rayleigh error is 0.85 as an error, within 5 %.
  EXPECT_GT(mean_px, 0.7);
  EXPECT_LT(mean_px, 1.3);

  Reconstruction moved = model;
  PerturbPoints(moved, 1.0, 3);
  EXPECT_EQ(judge.Measure(moved), judge.Measure(model));
  EXPECT_EQ(HeldOutJudge(tracks, 1.0, 50.0, 3).Measure(model), judge.Measure(model));
  const Sim3d there_from_here = {40.0, RotationAboutAxis({0.0, 0.6, 0.8}, 50.0), {9.0, 8.0, 7.0}};
  for (auto& [id, image] : moved.images) {
    image.cam_from_world = TransformCamera(there_from_here, image.cam_from_world);
  }
  EXPECT_NEAR(judge.MeanPx(judge.Measure(moved)), mean_px, 1e-5);
}

TEST(HeldOutJudge, ErrorsAreBounded) {
  Reconstruction model = MakeSyntheticModel({});
  const HeldOutJudge judge(TracksOf(model), 1.0, 20.0, 1);
  for (auto& [id, image] : model.images) {
    image.cam_from_world = Turned(image.cam_from_world, 50.0 * id);
  }
  for (const double error_px : judge.Measure(model)) {
    EXPECT_GE(error_px, 0.0);
    EXPECT_LE(error_px, 20.0);
  }
  // Without images there is nothing that explains a track.
  Reconstruction one = model;
  std::erase_if(one.images, [](const auto& entry) { return entry.first != 1; });
  EXPECT_EQ(judge.Measure(one), HeldOutJudge::Errors(720, 20.0));
  EXPECT_EQ(judge.Measure({}), HeldOutJudge::Errors(720, 20.0));
}

TEST(HeldOutJudge, WithoutTracksThereIsNoMean) {
  const HeldOutJudge judge({}, 1.0, 20.0, 1);
  EXPECT_TRUE(std::isnan(judge.MeanPx(judge.Measure(MakeSyntheticModel({})))));
  EXPECT_TRUE(judge.MeanPxByImage({}).empty());
  EXPECT_TRUE(judge.FindWorse({}, {}, 2.0).empty());
  EXPECT_THROW(HeldOutJudge({}, 0.0, 20.0, 1), std::invalid_argument);
  EXPECT_THROW(HeldOutJudge({}, 1.0, 1.0, 1), std::invalid_argument);
}

TEST(HeldOutJudge, NamesTheImageThatWasTurned) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    SyntheticModelOptions options;
    options.seed = seed;
    Reconstruction model = MakeSyntheticModel(options);
    ProjectAgain(model, 0.5, seed);
    const HeldOutJudge judge(TracksOf(model), 1.0, 50.0, 1);
    const HeldOutJudge::Errors before = judge.Measure(model);
    EXPECT_TRUE(judge.FindWorse(before, judge.Measure(model), 2.0).empty());
    const ImageId turned = 1 + seed;
    Rigid3d& pose = model.images.at(turned).cam_from_world;
    pose = Turned(pose, 0.5);  // 4.4 px
    const HeldOutJudge::Errors after = judge.Measure(model);
    // Others are drawn along, by less: the robust points stay with the five.
    const auto by_image = judge.MeanPxByImage(after);
    for (const auto& [id, mean_px] : by_image) {
      EXPECT_TRUE(id == turned || 2.0 * mean_px < by_image.at(turned)) << seed;
    }
    const std::vector<ImageId> worse = judge.FindWorse(before, after, 2.0);
    EXPECT_EQ(worse, std::vector<ImageId>{turned}) << seed;
  }
}

}  // namespace
}  // namespace vgtw
