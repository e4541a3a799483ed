// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class MaskVoteCommand : public testing::Test {
 protected:
  // A mover in the middle of the first view, which no mask tells.
  void SetUp() override {
    Prediction prediction = MakeWallPrediction();
    for (int y = 6; y < 18; ++y) {
      for (int x = 12; x < 24; ++x) prediction.views[0].depth(x, y) = 2.0f;
    }
    WritePrediction(prediction, folder_ / "in", /*overwrite=*/false);
  }
  ColmapRun Vote(std::vector<std::string> more = {}) const {
    std::vector<std::string> args = {"mask",
                                     "vote",
                                     "--predictions_path",
                                     (folder_ / "in").string(),
                                     "--output_path",
                                     (folder_ / "out").string()};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }
  const TemporaryFolder folder_;
};

TEST_F(MaskVoteCommand, FindsAMoverForMaskMake) {
  const std::string json = (folder_ / "vote.json").string();
  const ColmapRun run = Vote({"--json", json});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("a.png"));
  EXPECT_THAT(run.output, HasSubstr("written: predictions of 3 photos"));
  const nlohmann::json images = ReadJson(json)["images"];
  EXPECT_GT(images[0]["added_share"], 0.05);
  EXPECT_EQ(images[1]["added_share"], 0.0);

  const ColmapRun make = RunVgtw({"mask",
                                  "make",
                                  "--predictions_path",
                                  (folder_ / "out").string(),
                                  "--output_path",
                                  (folder_ / "masks").string()});
  ASSERT_EQ(make.exit_code, 0) << make.output;
  // The photo has twice the network's size.
  EXPECT_TRUE(IsExcluded(ReadStaticMask(folder_ / "masks/a.png.png"), 36.0, 24.0));
  EXPECT_FALSE(IsExcluded(ReadStaticMask(folder_ / "masks/a.png.png"), 4.0, 4.0));
  EXPECT_EQ(ExcludedShare(ReadStaticMask(folder_ / "masks/b.png.png")), 0.0);
}

TEST_F(MaskVoteCommand, RefusesToOverwriteAndAbsurdOptionsInOneLine) {
  ASSERT_EQ(Vote().exit_code, 0);
  const ColmapRun again = Vote();
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.output, HasSubstr("--overwrite"));
  for (const auto& [flag, value] : {std::pair("--window_px", "4"),
                                    {"--max_views", "0"},
                                    {"--max_views", "40"},
                                    {"--max_relative_depth_difference", "nan"},
                                    {"--mask_threshold", "-1"}}) {
    const ColmapRun run = Vote({"--overwrite", flag, value});
    EXPECT_EQ(run.exit_code, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr("must be")) << flag;
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  }
}

}  // namespace
}  // namespace vgtw
