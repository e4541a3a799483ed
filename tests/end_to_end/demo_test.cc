// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"
#include "scene/image_io.h"
#include "scene/reconstruction.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// The demo as `./quickstart` runs it, at its default noise.
TEST(Demo, MasksRemoveDistractorPointsAndImprovePoses) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  const std::string out = folder / "demo";
  const std::string json_path = folder / "demo.json";
  const ColmapRun run = RunVgtw({"demo", "--output_path", out, "--json", json_path});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const nlohmann::json report = ReadJson(json_path);
  const nlohmann::json& with = report["with_masks"];
  const nlohmann::json& without = report["without_masks"];

  EXPECT_EQ(with["points_on_distractors"], 0);
  EXPECT_GT(without["points_on_distractors"].get<int>(), 50);
  EXPECT_LT(with["refined_error"]["centre_rmse_percent"].get<double>(),
            without["refined_error"]["centre_rmse_percent"].get<double>());
  // One outline in network pixels wrong, as the demo makes it.
  EXPECT_GT(report["predicted_masks"]["iou"].get<double>(), 0.7);
  EXPECT_LT(report["predicted_masks"]["iou"].get<double>(), 1.0);
  // Refinement pays: at least twice as good as what it started from.
  EXPECT_LT(with["refined_error"]["centre_rmse_percent"].get<double>(),
            0.5 * with["feedforward_error"]["centre_rmse_percent"].get<double>());
  EXPECT_LT(with["refined_error"]["rotation_mean_deg"].get<double>(),
            0.5 * with["feedforward_error"]["rotation_mean_deg"].get<double>());
  for (const nlohmann::json& view : with["views"]) {
    EXPECT_EQ(view["status"], "refined") << view;
    EXPECT_EQ(view["num_excluded_keypoints"], 0) << view;
  }

  const Reconstruction refined = ReadModel(folder / "demo/with_masks/sparse/refined");
  EXPECT_EQ(FindFault(refined), "");
  EXPECT_EQ(refined.images.size(), with["views"].size());
  EXPECT_THAT(RunColmap({"model_analyzer", "--path", out + "/with_masks/sparse/refined"}).output,
              testing::HasSubstr("Registered images: " + std::to_string(refined.images.size())));
  EXPECT_GT(ReadImageSize(folder / "demo/contact_sheet.png").height, 500u);

  // A second run finds everything done.
  const auto before = Snapshot(folder / "demo");
  const ColmapRun again = RunVgtw({"run",
                                   "--image_path",
                                   out + "/photos",
                                   "--predictions_path",
                                   out + "/predictions",
                                   "--reference_path",
                                   out + "/truth/sparse",
                                   "--output_path",
                                   out + "/with_masks"});
  EXPECT_EQ(again.exit_code, 0) << again.output;
  EXPECT_THAT(again.output, testing::HasSubstr("refine: up to date"));
  EXPECT_THAT(again.output, testing::Not(testing::HasSubstr("running ")));
  auto after = Snapshot(folder / "demo");
  after["with_masks/run.json"] = before.at("with_masks/run.json");
  EXPECT_EQ(after, before);
}

}  // namespace
}  // namespace vgtw
