// SPDX-License-Identifier: BSD-3-Clause
// The demo as `./quickstart` runs it: the small network that comes with the repository looks at
// photos of a scene that it has never seen.
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

const std::string kTiny = VGTW_SOURCE_DIR "/examples/tiny/";

TEST(DemoNetwork, MasksAndPosesLeadToTheTruth) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  const std::string json_path = folder / "demo.json";
  const ColmapRun run = RunVgtw({"demo",
                                 "--weights_path",
                                 kTiny + "geometry.safetensors",
                                 "--lora_path",
                                 kTiny + "distractors.safetensors",
                                 "--output_path",
                                 folder / "demo",
                                 "--json",
                                 json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const nlohmann::json report = ReadJson(json_path);
  const nlohmann::json& with = report["with_masks"];
  EXPECT_GT(report["predicted_masks"]["iou"].get<double>(), 0.6);
  EXPECT_GT(report["without_masks"]["points_on_distractors"].get<int>(), 100);
  EXPECT_LT(with["points_on_distractors"].get<int>(), 10);
  // Poses degrees off end where nearly exact ones end (end_to_end/demo_test).
  EXPECT_LT(with["feedforward_error"]["centre_rmse_percent"].get<double>(), 10.0);
  EXPECT_LT(with["refined_error"]["centre_rmse_percent"].get<double>(), 0.05);
  for (const nlohmann::json& view : with["views"]) EXPECT_EQ(view["status"], "refined") << view;
}

TEST(DemoNetwork, WeightsThatSayNothingOfDistractorsAreNoted) {
  const TemporaryFolder folder;
  const ColmapRun run = RunVgtw({"demo",
                                 "--num_views",
                                 "3",
                                 "--weights_path",
                                 kTiny + "geometry.safetensors",
                                 "--output_path",
                                 folder / "demo"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, testing::HasSubstr("has no distractor probability"));
}

}  // namespace
}  // namespace vgtw
