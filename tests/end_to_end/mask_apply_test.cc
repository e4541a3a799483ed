// SPDX-License-Identifier: BSD-3-Clause
// `vgtw mask apply` and `vgtw mask restore`.
#include "tests/bridge/sample_masks.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class MaskApplyCommand : public testing::Test {
 protected:
  MaskApplyCommand() {
    MakeSampleDatabase(path_);
    WriteSampleMasks(folder_ / "masks");
  }
  ColmapRun Apply(const std::vector<std::string>& more) const {
    std::vector<std::string> args = {
        "mask", "apply", "--database_path", path_, "--mask_path", folder_ / "masks"};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }
  ColmapRun Restore(const std::vector<std::string>& more) const {
    std::vector<std::string> args = {"mask", "restore", "--database_path", path_};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }

  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "a.db";
};

TEST_F(MaskApplyCommand, TellsWhatWentAndHowToUndoIt) {
  const std::string original = DumpRows(path_);
  const ColmapRun apply = Apply({"--in_place",
                                 "--rule",
                                 "keypoints",
                                 "--min_num_inliers",
                                 "1",
                                 "--json",
                                 folder_ / "apply.json"});
  ASSERT_EQ(apply.exit_code, 0) << apply.output;
  EXPECT_THAT(apply.output, HasSubstr("matches: 12 -> 4\ninlier matches: 4 -> 1\n"));
  EXPECT_THAT(apply.output, HasSubstr("pairs with a geometry: 2 -> 1\n"));
  EXPECT_THAT(apply.output, HasSubstr("undo: vgtw mask restore --database_path " + path_.string()));
  const nlohmann::json json = ReadJson(folder_ / "apply.json");
  EXPECT_EQ(json["rule"], "keypoints");
  EXPECT_EQ(json["num_matches_after"], 4);
  EXPECT_EQ(json["images"][0]["num_excluded_keypoints"], 2);
  const ColmapRun restore = Restore({"--in_place", "1"});
  ASSERT_EQ(restore.exit_code, 0) << restore.output;
  EXPECT_THAT(restore.output,
              HasSubstr("keypoints of 3 images, matches of 3 pairs, geometries of 2 pairs\n"));
  EXPECT_EQ(DumpRows(path_), original);
}

TEST_F(MaskApplyCommand, RefusesWrongRequestsInOneLine) {
  const auto expect = [](const ColmapRun& run, const char* text) {
    EXPECT_EQ(run.exit_code, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr(text));
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  };
  const auto before = Snapshot(folder_.path());
  const std::string other = folder_ / "b.db";
  expect(Apply({}), "no target");
  expect(Apply({"--in_place", "--output_path", other}), "two targets");
  expect(Apply({"--in_place", "--input_path", folder_ / "sparse"}), "half of a model");
  expect(Apply({"--in_place", "--dilate_px", "-1"}), "dilate_px = -1");
  expect(Apply({"--in_place", "--dilate_scale", "nan"}), "dilate_scale = nan");
  expect(Apply({"--in_place", "--dilate_scale", "1"}), "have no scale (2 columns)");
  expect(Apply({"--output_path", other, "--input_path", other, "--model_output_path", "m"}),
         "b.db: is not a folder");
  expect(Restore({}), "no target or two");
  expect(Restore({"--in_place", "--output_path", other}), "no target or two");
  expect(Restore({"--in_place"}), "keeps no originals");
  EXPECT_EQ(Snapshot(folder_.path()), before);
}

}  // namespace
}  // namespace vgtw
