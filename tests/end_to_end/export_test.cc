// SPDX-License-Identifier: BSD-3-Clause
// `vgtw export`, read back by the other commands.
#include "bridge/colmap_model.h"
#include "bridge/point_cloud.h"
#include "scene/files.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class ExportTest : public testing::Test {
 protected:
  ExportTest() { WriteModel(model_, model_path_, {}); }

  ColmapRun Export(const std::string& format, const std::string& name) const {
    return RunVgtw({"export",
                    "--input_path",
                    model_path_,
                    "--format",
                    format,
                    "--label",
                    "name",
                    "--output_path",
                    (folder_ / name).string()});
  }

  TemporaryFolder folder_;
  const std::string model_path_ = (folder_ / "sparse").string();
  const Reconstruction model_ = MakeSyntheticModel({});
};

TEST_F(ExportTest, CamerasAreTheModels) {
  const std::string json_path = (folder_ / "errors.json").string();
  for (const auto& [format, name] : {std::pair("transforms", "transforms.json"),
                                     std::pair("tum", "tum.txt"),
                                     std::pair("kitti", "kitti.txt")}) {
    const ColmapRun written = Export(format, name);
    ASSERT_EQ(written.exit_code, 0) << written.output;
    EXPECT_THAT(written.output, HasSubstr("6 cameras"));
    const ColmapRun read = RunVgtw({"evaluate",
                                    "pose",
                                    "--input_path",
                                    (folder_ / name).string(),
                                    "--reference_path",
                                    model_path_,
                                    "--alignment",
                                    "none",
                                    "--json",
                                    json_path});
    ASSERT_EQ(read.exit_code, 0) << read.output;
    const nlohmann::json errors = ReadJson(json_path);
    ASSERT_EQ(errors.at("views").size(), 6u);
    for (const nlohmann::json& view : errors.at("views")) {
      EXPECT_LT(view.at("centre"), 1e-12) << format;
      // An arc cosine of 1 less rounding.
      EXPECT_LT(view.at("rotation_deg"), 1e-6) << format;
    }
  }
}

TEST_F(ExportTest, PointsAreTheModels) {
  ASSERT_EQ(Export("ply", "points.ply").exit_code, 0);
  const std::vector<ColoredPoint> points = ReadPly(folder_ / "points.ply");
  ASSERT_EQ(points.size(), model_.points3D.size());
  for (size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].xyz, model_.points3D.at(i + 1).xyz.cast<float>());
  }
  ASSERT_EQ(Export("pcd", "points.pcd").exit_code, 0);
  EXPECT_THAT(ReadFile(folder_ / "points.pcd"), HasSubstr("POINTS 120\n"));
}

TEST_F(ExportTest, RefusesWhatItCannotDo) {
  WriteFileAtomically(folder_ / "mine.ply", "mine");
  const ColmapRun refused = Export("ply", "mine.ply");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.output, HasSubstr("--overwrite"));
  EXPECT_EQ(ReadFile(folder_ / "mine.ply"), "mine");
  const ColmapRun nothing = RunVgtw({"export",
                                     "--input_path",
                                     folder_.path().string(),
                                     "--output_path",
                                     (folder_ / "a.ply").string()});
  EXPECT_EQ(nothing.exit_code, 1);
  EXPECT_THAT(nothing.output, HasSubstr("COLMAP model or a predictions folder"));
}

}  // namespace
}  // namespace vgtw
