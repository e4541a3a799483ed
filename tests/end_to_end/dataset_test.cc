// SPDX-License-Identifier: BSD-3-Clause
// The commands around training data: dataset check, stats, corrupt.
#include "bridge/mask_files.h"
#include "scene/image_io.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class DatasetCommands : public testing::Test {
 protected:
  // Four photos of 112 x 84 in each of two scenes; distractors in the left columns.
  DatasetCommands() {
    for (const std::string scene : {"hall", "patio 2"}) {
      for (int i = 0; i < 4; ++i) {
        const std::string name = scene + "/" + std::to_string(i) + ".jpg";
        WriteImage(folder_ / "photos" / name, RgbImage(112, 84, Rgb{90, 120, 60}));
        AddMask(name, 14 * i);
      }
    }
  }
  void AddMask(const std::string& name, int num_columns) const {
    StaticMask static_mask(112, 84, 255);
    for (int y = 0; y < 84; ++y) {
      for (int x = 0; x < num_columns; ++x) static_mask(x, y) = 0;
    }
    WriteImage(MaskPath(folder_ / "masks", name), static_mask);
  }
  ColmapRun Run(const std::string& command, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> args = {"dataset",
                                     command,
                                     "--image_path",
                                     (folder_ / "photos").string(),
                                     "--mask_path",
                                     (folder_ / "masks").string()};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }

  const TemporaryFolder folder_;
};

TEST_F(DatasetCommands, CheckLetsGoodDataPass) {
  const std::string json_path = (folder_ / "check.json").string();
  const ColmapRun run = Run("check", {"--json", json_path});
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("2 scenes: can be trained on, 0 warnings\n"));
  const auto json = ReadJson(json_path);
  EXPECT_EQ(json.at("is_trainable"), true);
  EXPECT_EQ(json.at("scenes")[1].at("name"), "patio 2");
  EXPECT_EQ(json.at("scenes")[1].at("num_masks"), 4);
  EXPECT_DOUBLE_EQ(json.at("scenes")[1].at("distractor_share"), 6 * 14 / (4 * 112.0));
}

TEST_F(DatasetCommands, CheckFailsInOneLineAndNamesEachFault) {
  fs::remove(folder_ / "masks/hall/1.jpg.png");
  WriteImage(folder_ / "masks/hall/2.jpg.png", StaticMask(30, 30, 255));
  for (int i = 1; i < 4; ++i) fs::remove(folder_ / "photos/patio 2" / (std::to_string(i) + ".jpg"));
  const ColmapRun run = Run("check");
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, HasSubstr("error missing-mask: the photo has no mask; to do: "));
  EXPECT_THAT(run.output, HasSubstr("\n  hall/1.jpg\n"));
  EXPECT_THAT(run.output, HasSubstr("\n  hall/2.jpg: 30 x 30, the photo 112 x 84\n"));
  EXPECT_THAT(run.output, HasSubstr("error few-photos: "));
  EXPECT_THAT(run.output, HasSubstr("warning orphan-mask: "));
  EXPECT_THAT(run.output, HasSubstr("\n  patio 2/3.jpg.png\n"));
  EXPECT_THAT(run.output, HasSubstr("vgtw dataset check: 3 errors in "));
}

TEST_F(DatasetCommands, CheckOnlyWarnsOfWhatCanBeTrainedOn) {
  for (int i = 0; i < 4; ++i) AddMask("hall/" + std::to_string(i) + ".jpg", 0);
  const ColmapRun run = Run("check", {"--width", "518", "--height", "392"});
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("warning no-mask-excludes: "));
  EXPECT_THAT(run.output, HasSubstr("  hall/0.jpg: 112 x 84, the network sees 518 x 392\n"));
  EXPECT_THAT(run.output, HasSubstr("can be trained on, 9 warnings\n"));
  EXPECT_THAT(Run("check", {"--width", "100"}).output, HasSubstr("must be a multiple of 14"));
}

// At 112 x 84 the cut is the photo and a patch 14 x 14 of its pixels: i of 8 columns of 6 are
// distractor in photo i.
TEST_F(DatasetCommands, StatsTellPixelsAndPatches) {
  AddMask("hall/1.jpg", 4);  // 4 of 14: mixed
  const std::string json_path = (folder_ / "stats.json").string();
  const ColmapRun run = Run("stats", {"--json", json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("112 x 84"));
  const auto json = ReadJson(json_path);
  const auto& hall = json.at("scenes")[0];
  EXPECT_EQ(hall.at("name"), "hall");
  EXPECT_EQ(hall.at("num_views"), 4);
  EXPECT_EQ(hall.at("num_without_distractor"), 1);
  EXPECT_DOUBLE_EQ(hall.at("mean_distractor_share"), (4 + 28 + 42) / (4 * 112.0));
  EXPECT_DOUBLE_EQ(hall.at("min_distractor_share"), 0.0);
  EXPECT_DOUBLE_EQ(hall.at("max_distractor_share"), 42 / 112.0);
  EXPECT_EQ(hall.at("num_distractor_patches"), (2 + 3) * 6);
  EXPECT_EQ(hall.at("num_mixed_patches"), 6);
  EXPECT_EQ(hall.at("num_static_patches"), (8 + 7 + 6 + 5) * 6);
  const auto& total = json.at("total");
  EXPECT_EQ(total.at("num_photos"), 8);
  EXPECT_EQ(total.at("num_distractor_patches"), (2 + 3 + 1 + 2 + 3) * 6);
  EXPECT_EQ(total.at("sizes")[0].at("num_views"), 8);
}

TEST_F(DatasetCommands, CorruptIsRepeatableAndTrainable) {
  const std::string dirty = (folder_ / "dirty").string();
  const std::vector<std::string> flags = {"--share", "0.5", "--seed", "3", "--output_path"};
  const auto with = [&](const std::string& path) {
    std::vector<std::string> args = flags;
    args.push_back(path);
    return args;
  };
  const auto masks = Snapshot(folder_ / "masks");
  const ColmapRun run = Run("corrupt", with(dirty));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output,
              HasSubstr("all static now: 3 of 6 masks that held a distractor (of 8 masks)\n"));
  const auto record = ReadJson(dirty + "/corrupted.json");
  EXPECT_EQ(record.at("corrupted").size(), 3);
  EXPECT_EQ(record.at("seed"), 3);
  EXPECT_TRUE(Snapshot(folder_ / "masks") == masks);
  ASSERT_EQ(Run("corrupt", with(dirty + "2")).exit_code, 0);
  EXPECT_TRUE(Snapshot(dirty) == Snapshot(dirty + "2"));
  const ColmapRun check = RunVgtw(
      {"dataset", "check", "--image_path", (folder_ / "photos").string(), "--mask_path", dirty});
  EXPECT_EQ(check.exit_code, 0) << check.output;
  EXPECT_THAT(check.output, Not(HasSubstr("orphan-mask")));
  const ColmapRun again = Run("corrupt", with(dirty));
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.output, HasSubstr("add --overwrite"));
}

}  // namespace
}  // namespace vgtw
