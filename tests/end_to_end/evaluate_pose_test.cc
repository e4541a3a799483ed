// SPDX-License-Identifier: BSD-3-Clause
#include "scene/files.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

// Four cameras on a square of side 2, which look the same way; timestamps.
const std::string kReference =
    "1.0 0 0 0 0 0 0 1\n2.0 2 0 0 0 0 0 1\n3.0 2 2 0 0 0 0 1\n4.0 0 2 0 0 0 0 1\n";

class EvaluatePose : public testing::Test {
 protected:
  void SetUp() override { WriteFileAtomically(folder_ / "truth.txt", kReference); }

  ColmapRun Run(const std::string& estimate, const std::vector<std::string>& flags = {}) const {
    WriteFileAtomically(folder_ / "estimate.txt", estimate);
    std::vector<std::string> args = {"evaluate",
                                     "pose",
                                     "--input_path",
                                     (folder_ / "estimate.txt").string(),
                                     "--reference_path",
                                     (folder_ / "truth.txt").string(),
                                     "--json",
                                     (folder_ / "pose.json").string()};
    args.insert(args.end(), flags.begin(), flags.end());
    return RunVgtw(args);
  }

  const TemporaryFolder folder_;
};

TEST_F(EvaluatePose, EveryFigureTellsItsUnitAlignmentAndViews) {
  // One camera 0.4 away, one missing.
  const ColmapRun run = Run("1.0 0 0 0.4 0 0 0 1\n2.001 2 0 0 0 0 0 1\n3.0 2 2 0 0 0 0 1\n",
                            {"--alignment", "none", "--auc", "3,5"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("ATE 0.230940 scene units"));
  EXPECT_THAT(run.output, HasSubstr("not aligned, 3 of 4 views"));
  EXPECT_THAT(run.output, HasSubstr("delta 1 in the order of timestamps, 2 pairs"));
  EXPECT_THAT(run.output, HasSubstr("AUC histogram (VGGT)"));
  EXPECT_THAT(run.output, HasSubstr("AUC trapezoid (COLMAP)"));
  EXPECT_THAT(run.output, HasSubstr("missing in the estimate (1): 4.0\n"));

  const nlohmann::json json = ReadJson(folder_ / "pose.json");
  EXPECT_NEAR(json["ate"]["rmse"], 0.4 / std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(json["rpe"]["translation"]["mean"], 0.2, 1e-12);
  EXPECT_EQ(json["rpe"]["order"], "timestamps");
  EXPECT_EQ(json["views"][0]["name"], "1.0");
  EXPECT_NEAR(json["views"][0]["centre"], 0.4, 1e-12);
  EXPECT_EQ(json["missing"][0], "4.0");
  EXPECT_EQ(json["alignment"], "not aligned");
  EXPECT_EQ(json["accuracy"]["thresholds"][1]["threshold_deg"], 5.0);
  EXPECT_EQ(json["accuracy"]["thresholds"][1]["rra"], 1.0);
}

TEST_F(EvaluatePose, AlignmentsChangeWhatTheySay) {
  const std::string twice =
      "1.0 5 0 0 0 0 0 1\n2.0 9 0 0 0 0 0 1\n3.0 9 4 0 0 0 0 1\n4.0 5 4 0 0 0 0 1\n";
  const auto ate = [&](const std::vector<std::string>& flags) {
    const ColmapRun run = Run(twice, flags);
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return ReadJson(folder_ / "pose.json")["ate"]["rmse"].get<double>();
  };
  EXPECT_NEAR(ate({}), 0.0, 1e-12);
  EXPECT_NEAR(ate({"--alignment", "sim3", "--robust"}), 0.0, 1e-12);
  EXPECT_NEAR(ate({"--alignment", "se3"}), std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(ate({"--alignment", "first"}), 2.0, 1e-12);
  EXPECT_THAT(Run(twice, {"--robust"}).output,
              HasSubstr("robustly Sim3-aligned on 4 of them, 4 of 4 views"));
}

TEST_F(EvaluatePose, WrongFlagsAndInputsAreOneLine) {
  const auto expect_error = [](const ColmapRun& run, const std::string& text) {
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.output, HasSubstr(text));
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  };
  expect_error(Run(kReference, {"--alignment", "none", "--robust"}), "sim3 or se3");
  expect_error(Run(kReference, {"--auc", "0"}), "degrees from 1 to 180");
  expect_error(Run(kReference, {"--rpe_delta", "0"}), "delta = 0");
  expect_error(Run("hello\n"), "none of the known forms");
  expect_error(Run("1.0 0 0 0 0 0 0 1\n"), "shares 1 views");
}

}  // namespace
}  // namespace vgtw
