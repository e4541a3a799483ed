// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_vote_folder.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

void Fill(Grid<float>& map, int left, int top, float value) {
  for (int y = top; y < top + 8; ++y) {
    for (int x = left; x < left + 8; ++x) map(x, y) = value;
  }
}

// The wall with a mover in front of it in two views, 8 x 8 network pixels: in "a.png" it is masked,
// in "b.png" it is not; there is a square of the wall masked in "a.png", too.
Prediction MoverPrediction() {
  Prediction prediction = MakeWallPrediction();
  prediction.weights_hash = "0123";
  for (ViewPrediction& view : prediction.views) view.distractor = DistractorMask(32, 24, 0.25f);
  Fill(prediction.views[0].depth, 20, 2, 2.0f);
  Fill(prediction.views[0].distractor, 20, 2, 1.0f);
  Fill(prediction.views[0].distractor, 20, 14, 1.0f);
  Fill(prediction.views[1].depth, 8, 12, 2.0f);
  return prediction;
}

VoteOnMasksOptions Options() {
  VoteOnMasksOptions options;
  options.vote.position_error_px = 0;
  options.vote.window_px = 3;
  options.num_threads = 1;
  return options;
}

class MaskVoteFolder : public testing::Test {
 protected:
  VoteOnMasksSummary Vote(const Prediction& prediction,
                          const VoteOnMasksOptions& options = Options()) {
    WritePrediction(prediction, folder_ / "in", /*overwrite=*/true);
    return VoteOnMasks(PredictionReader(folder_ / "in"), folder_ / "out", options);
  }
  const TemporaryFolder folder_;
};

TEST_F(MaskVoteFolder, MendsMasksAndLeavesEverythingElse) {
  const Prediction before = MoverPrediction();
  const VoteOnMasksSummary summary = Vote(before);
  const Prediction after = ReadPrediction(folder_ / "out");
  EXPECT_TRUE(summary.may_release);
  EXPECT_EQ(after.producer, before.producer);
  EXPECT_EQ(after.weights_hash, before.weights_hash);
  ASSERT_EQ(after.views.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(after.views[i].view.name, before.views[i].view.name);
    EXPECT_EQ(after.views[i].depth, before.views[i].depth);
    EXPECT_EQ(summary.views[i].num_voters, 2u);
  }
  EXPECT_EQ(after.views[0].distractor(24, 18), 0.0f);  // the wall is released
  EXPECT_EQ(after.views[0].distractor(24, 5), 1.0f);   // the mover is not
  EXPECT_EQ(after.views[1].distractor(12, 16), 1.0f);  // the missing one is added
  EXPECT_EQ(after.views[1].distractor(2, 2), 0.25f);
  EXPECT_EQ(after.views[2].distractor, before.views[2].distractor);
  // 128 of 768 pixels were masked; the square loses up to its corners (4 of 9 in their window), the
  // mover's inner 6 x 6 pixels, which are no depth edge, are added but for their corners.
  EXPECT_DOUBLE_EQ(summary.views[0].masked_share_before, 128.0 / 768.0);
  EXPECT_DOUBLE_EQ(summary.views[0].released_share, 64.0 / 768.0);
  EXPECT_DOUBLE_EQ(summary.views[1].added_share, 32.0 / 768.0);
}

TEST_F(MaskVoteFolder, ReleasesNothingWhereDepthIsThatBehindTheMasks) {
  Prediction before = MakeWallPrediction();
  for (ViewPrediction& view : before.views) {
    view.distractor = DistractorMask(32, 24, 0.25f);
    Fill(view.distractor, 20, 2, 1.0f);
  }
  const VoteOnMasksSummary summary = Vote(before);
  EXPECT_FALSE(summary.may_release);
  EXPECT_EQ(summary.masked.num_distractor, 0u);
  EXPECT_GT(summary.masked.num_static, 0u);
  const Prediction after = ReadPrediction(folder_ / "out");
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(after.views[i].distractor, before.views[i].distractor);
  }
}

TEST_F(MaskVoteFolder, MakesMasksFromNothingAndCopiesViewsWithoutDepth) {
  Prediction before = MoverPrediction();
  for (ViewPrediction& view : before.views) view.distractor = {};
  before.views.push_back(MakeWallView("d.png", 0.25));
  before.views[3].depth = {};
  before.views[3].depth_samples = {{{3.0f, 4.0f}, 5.0f, 1.0f}};
  const VoteOnMasksSummary summary = Vote(before);
  const Prediction after = ReadPrediction(folder_ / "out");
  EXPECT_EQ(after.views[0].distractor(24, 5), 1.0f);
  EXPECT_EQ(after.views[0].distractor(24, 18), 0.0f);
  EXPECT_TRUE(after.views[3].distractor.empty());
  EXPECT_EQ(after.views[3].depth_samples.size(), 1u);
  EXPECT_EQ(summary.views[3].num_voters, 0u);
  EXPECT_EQ(summary.views[0].num_voters, 2u);
}

TEST_F(MaskVoteFolder, HoldsNoMoreViewsThanAllowed) {
  Prediction before;
  for (int i = 0; i < 20; ++i) {
    before.views.push_back(MakeWallView("view" + std::to_string(100 + i) + ".png", 0.1 * i));
  }
  VoteOnMasksOptions options = Options();
  options.vote.max_views = 3;
  options.max_cached_views = 4;
  VoteOnMasksSummary summary = Vote(before, options);
  EXPECT_EQ(summary.max_views_held, 4u);
  // Twice a view and its voters at most, and once to write it; neighbours are mostly at hand.
  EXPECT_LT(summary.num_loads, 2u * 20u * 4u / 2u + 20u);
  options.max_cached_views = 20;
  options.overwrite = true;
  const std::string bounded = ReadFile(folder_ / "out/views/view105.png.safetensors");
  summary = Vote(before, options);
  EXPECT_EQ(summary.max_views_held, 20u);
  EXPECT_EQ(summary.num_loads, 20u + 20u);
  EXPECT_EQ(ReadFile(folder_ / "out/views/view105.png.safetensors"), bounded);
}

TEST_F(MaskVoteFolder, ThreadsAndProgressDoNotChangeTheResult) {
  Vote(MoverPrediction());
  const auto one = Snapshot(folder_ / "out");
  VoteOnMasksOptions options = Options();
  options.num_threads = 3;
  options.overwrite = true;
  std::vector<int64_t> done;
  VoteOnMasks(
      PredictionReader(folder_ / "in"), folder_ / "out", options, [&](int64_t i, int64_t total) {
        done.push_back(i);
        EXPECT_EQ(total, 6);
      });
  EXPECT_EQ(Snapshot(folder_ / "out"), one);
  EXPECT_EQ(done, (std::vector<int64_t>{1, 2, 3, 4, 5, 6}));
}

TEST_F(MaskVoteFolder, TellsWhatItCannotUse) {
  Prediction no_depth = MakeWallPrediction();
  for (ViewPrediction& view : no_depth.views) {
    view.depth = {};
    view.depth_samples = {{{3.0f, 4.0f}, 5.0f, 1.0f}};
  }
  no_depth.views[1].depth = DepthMap(32, 24, kNaN);
  EXPECT_THAT([&] { Vote(no_depth); },
              testing::ThrowsMessage<Error>(HasSubstr("holds no depth of any view")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  const PredictionReader reader(folder_ / "in");
  EXPECT_THAT([&] { VoteOnMasks(reader, folder_ / "in", Options()); },
              testing::ThrowsMessage<Error>(HasSubstr("which is read")));
  VoteOnMasksOptions options = Options();
  options.max_cached_views = options.vote.max_views;
  EXPECT_THROW(VoteOnMasks(reader, folder_ / "out", options), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
