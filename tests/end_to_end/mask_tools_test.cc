// SPDX-License-Identifier: BSD-3-Clause
// The commands that judge and move masks: score, preview, undistort.
#include "bridge/colmap_model.h"
#include "bridge/mask_files.h"
#include "scene/files.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

StaticMask LeftOf(int end) {
  StaticMask mask(40, 20, 255);
  for (int y = 0; y < 20; ++y) std::fill_n(&mask(0, y), end, uint8_t{0});
  return mask;
}

class MaskTools : public testing::Test {
 protected:
  // a.jpg is half right (10 of 20 columns), `b "2".jpg` has no distractor and no mask of one.
  void SetUp() override {
    for (const char* name : {"a.jpg", "b \"2\".jpg"}) {
      WriteImage(folder_.path() / "photos" / name, RgbImage(40, 20, Rgb{90, 90, 90}));
      WriteImage(MaskPath(folder_ / "truth", name), LeftOf(*name == 'a' ? 10 : 0));
      WriteImage(MaskPath(folder_ / "masks", name), LeftOf(*name == 'a' ? 20 : 0));
    }
  }
  // "@x" stands for "<folder>/x".
  ColmapRun Run(std::vector<std::string> args) const {
    for (std::string& arg : args) {
      if (arg.starts_with('@')) arg = (folder_ / arg.substr(1)).string();
    }
    return RunVgtw(args);
  }
  const TemporaryFolder folder_;
};

TEST_F(MaskTools, ScoreTellsTheMeanAndThePooledRatios) {
  const ColmapRun run = Run({"mask",
                             "score",
                             "--mask_path",
                             "@masks",
                             "--reference_mask_path",
                             "@truth",
                             "--image_path",
                             "@photos",
                             "--json",
                             "@score.json",
                             "--csv",
                             "@score.csv"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("mean of 2 images"));
  EXPECT_THAT(run.output, HasSubstr("positive = distractor"));
  const nlohmann::json score = ReadJson(folder_ / "score.json");
  EXPECT_EQ(score["images"][0]["name"], "a.jpg");
  EXPECT_EQ(score["images"][0]["precision"], 0.5);
  EXPECT_EQ(score["images"][0]["recall"], 1.0);
  EXPECT_EQ(score["images"][1]["f1"], 1.0);
  EXPECT_EQ(score["mean"]["precision"], 0.75);
  EXPECT_EQ(score["pooled"]["precision"], 0.5);
  EXPECT_EQ(ReadFile(folder_ / "score.csv"),
            "image,accuracy,precision,recall,f1,iou,dice,boundary_f\n"
            "\"a.jpg\",0.750000,0.500000,1.000000,0.666667,0.500000,0.666667,0.000000\n"
            "\"b \"\"2\"\".jpg\",1.000000,1.000000,1.000000,1.000000,1.000000,1.000000,1.000000\n");
}

TEST_F(MaskTools, EvaluateMasksIsTheSameCommand) {
  const std::vector<std::string> flags = {
      "--mask_path", "@masks", "--reference_mask_path", "@truth", "--json", "@score.json"};
  std::vector<std::string> outputs;
  std::vector<nlohmann::json> scores;
  for (auto args : {std::vector<std::string>{"mask", "score"}, {"evaluate", "masks"}}) {
    args.insert(args.end(), flags.begin(), flags.end());
    const ColmapRun run = Run(args);
    ASSERT_EQ(run.exit_code, 0) << run.output;
    outputs.push_back(run.output);
    scores.push_back(ReadJson(folder_ / "score.json"));
  }
  EXPECT_EQ(outputs[0], outputs[1]);
  EXPECT_EQ(scores[0], scores[1]);
}

TEST_F(MaskTools, ScoreNeedsOneThingToScore) {
  const ColmapRun run = Run({"mask", "score", "--reference_mask_path", "@truth"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, HasSubstr("one of --mask_path and --predictions_path"));
}

TEST_F(MaskTools, PreviewWritesAPicture) {
  const std::vector<std::string> args = {"mask",
                                         "preview",
                                         "--image_path",
                                         "@photos",
                                         "--mask_path",
                                         "@masks",
                                         "--output_path",
                                         "@preview.jpg",
                                         "--json",
                                         "@preview.json"};
  const ColmapRun run = Run(args);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("a.jpg           50.00"));
  EXPECT_EQ(ReadRgbImage(folder_ / "preview.jpg").width(), 2 * 400 + 3 * 8);
  EXPECT_EQ(ReadJson(folder_ / "preview.json")["images"][0]["excluded_share"], 0.5);
  const ColmapRun again = Run(args);
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.output, HasSubstr("--overwrite"));
}

TEST_F(MaskTools, UndistortLeavesTheMasksOfPinholes) {
  Reconstruction model;
  model.cameras[1] = MakePinhole(40, 20, 30.0, 30.0);
  model.cameras[1].camera_id = 1;
  model.images[1].image_id = 1;
  model.images[1].camera_id = 1;
  model.images[1].name = "a.jpg";
  WriteModel(model, folder_ / "sparse");
  const ColmapRun run = Run({"mask",
                             "undistort",
                             "--mask_path",
                             "@masks",
                             "--input_path",
                             "@sparse",
                             "--output_path",
                             "@out",
                             "--json",
                             "@out.json"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_EQ(Snapshot(folder_ / "out").size(), 1u);
  EXPECT_EQ(ReadStaticMask(folder_ / "out/a.jpg.png"), LeftOf(20));
  EXPECT_EQ(ReadJson(folder_ / "out.json")["images"][0]["has_mask"], true);
}

}  // namespace
}  // namespace vgtw
