// SPDX-License-Identifier: BSD-3-Clause
// vgtw evaluate points and depth, on a made scene with exact truth.
#include "bridge/point_cloud.h"
#include "bridge/predictions.h"
#include "scene/perturb.h"
#include "scene/synthetic.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class EvaluateClouds : public testing::Test {
 protected:
  void SetUp() override {
    SyntheticOptions options;
    options.num_views = 5;
    options.width = 160;
    options.height = 120;
    const Prediction truth = MakeTruePrediction(SyntheticScene(options), 112);
    WritePrediction(truth, folder_ / "truth", false);
    WritePrediction(Perturb(truth, {}), folder_ / "predictions", false);
  }
  // "@x" stands for "<folder>/x".
  ColmapRun Run(std::vector<std::string> args) const {
    for (std::string& arg : args) {
      if (arg.starts_with('@')) arg = (folder_ / arg.substr(1)).string();
    }
    return RunVgtw(args);
  }
  nlohmann::json Evaluate(std::vector<std::string> args) const {
    args.insert(args.begin(), "evaluate");
    args.insert(args.end(), {"--reference_path", "@truth", "--json", "@result.json"});
    const ColmapRun run = Run(args);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return ReadJson(folder_ / "result.json");
  }

  const TemporaryFolder folder_;
};

TEST_F(EvaluateClouds, PointsOfTheTruthHaveNoError) {
  const nlohmann::json result =
      Evaluate({"points", "--input_path", "@truth", "--keep_percent", "100"});
  EXPECT_LT(result["overall"].get<double>(), 1e-12);
  EXPECT_EQ(result["f_percent"].get<double>(), 100.0);
  EXPECT_NEAR(result["normal_consistency_mean"].get<double>(), 1.0, 1e-6);
}

TEST_F(EvaluateClouds, PointsNameWhatTheyHoldUnder) {
  const ColmapRun run = Run({"evaluate",
                             "points",
                             "--input_path",
                             "@predictions",
                             "--reference_path",
                             "@truth",
                             "--icp",
                             "similarity",
                             "--voxel_size",
                             "0.05",
                             "--clip_distance",
                             "0.5",
                             "--json",
                             "@result.json"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  for (const char* part : {"Sim3-aligned (Umeyama) on",
                           "then similarity ICP within 0.1",
                           "50.0 % most confident of all views (confidence from ",
                           "means in cubes of 0.05",
                           "distances above 0.5",
                           "scene units"}) {
    EXPECT_THAT(run.output, HasSubstr(part));
  }
  const nlohmann::json result = ReadJson(folder_ / "result.json");
  EXPECT_EQ(result["alignment"]["method"], "pixels");
  EXPECT_EQ(result["icp"]["kind"], "similarity");
  EXPECT_EQ(result["filter"]["keep_percent"], 50.0);
  EXPECT_EQ(result["reference_filter"]["keep_percent"], 100.0);
  EXPECT_GT(result["overall"].get<double>(), 0.0);
}

TEST_F(EvaluateClouds, PlyIsAlignedByIcpAlone) {
  WritePly(folder_ / "a.ply", {{{0, 0, 0}, {}}, {{1, 0, 0}, {}}, {{0, 1, 0}, {}}, {{0, 0, 2}, {}}});
  WritePly(folder_ / "b.ply",
           {{{0.05f, 0, 0}, {}}, {{1.05f, 0, 0}, {}}, {{0.05f, 1, 0}, {}}, {{0.05f, 0, 2}, {}}});
  const ColmapRun run = Run({"evaluate",
                             "points",
                             "--input_path",
                             "@a.ply",
                             "--reference_path",
                             "@b.ply",
                             "--icp",
                             "rigid",
                             "--json",
                             "@result.json"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const nlohmann::json result = ReadJson(folder_ / "result.json");
  EXPECT_EQ(result["alignment"]["method"], "none");
  EXPECT_LT(result["accuracy"]["mean"].get<double>(), 1e-7);  // floats
}

TEST_F(EvaluateClouds, DepthByBothMethods) {
  const nlohmann::json reprojected =
      Evaluate({"depth", "--input_path", "@truth", "--cloud", "own", "--keep_percent", "100"});
  EXPECT_LT(reprojected["pixels"]["abs_rel"].get<double>(), 1e-6);
  EXPECT_EQ(reprojected["mean"]["within_1_25_percent"].get<double>(), 100.0);
  EXPECT_EQ(reprojected["views"].size(), 5u);
  const nlohmann::json maps = Evaluate({"depth",
                                        "--input_path",
                                        "@predictions",
                                        "--method",
                                        "maps",
                                        "--depth_alignment",
                                        "scale_shift",
                                        "--fit",
                                        "all",
                                        "--keep_percent",
                                        "100"});
  // Depths were disturbed by about 1 %, and by 2 % of the focal length, which they do not show.
  EXPECT_GT(maps["pixels"]["abs_rel"].get<double>(), 0.002);
  EXPECT_LT(maps["pixels"]["abs_rel"].get<double>(), 0.03);
}

TEST_F(EvaluateClouds, WrongOptionsAreToldInOneLine) {
  ColmapRun run = Run({"evaluate",
                       "points",
                       "--input_path",
                       "@predictions",
                       "--reference_path",
                       "@truth",
                       "--f_distance",
                       "-1"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, HasSubstr("f_distance = -1"));
  run = Run({"evaluate", "depth", "--input_path", "@absent", "--reference_path", "@truth"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, HasSubstr("expected a predictions folder"));
}

}  // namespace
}  // namespace vgtw
