// SPDX-License-Identifier: BSD-3-Clause
// `vgtw export`, read back by the other commands.
#include "bridge/colmap_model.h"
#include "bridge/export_glb.h"
#include "bridge/point_cloud.h"
#include "bridge/predictions.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/bridge/colmap_map.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

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
  const std::string pcd = ReadFile(folder_ / "points.pcd");
  EXPECT_THAT(pcd, HasSubstr("POINTS 120\n"));
  EXPECT_THAT(pcd, HasSubstr("FIELDS x y z rgb error track_length\n"));
}

class ExportPredictionsTest : public testing::Test {
 protected:
  ExportPredictionsTest() {
    WritePrediction(MakeWallPrediction(), predictions_, false);
    for (const char* name : {"a.png", "b.png", "c.png"}) {
      WriteImage(folder_.path() / "photos" / name, RgbImage(64, 48, Rgb{200, 100, 50}));
    }
  }

  ColmapRun Export(std::vector<std::string> args) const {
    const std::vector<std::string> first = {"export", "--input_path", predictions_};
    args.insert(args.begin(), first.begin(), first.end());
    return RunVgtw(args);
  }

  TemporaryFolder folder_;
  const std::string predictions_ = (folder_ / "predictions").string();
};

TEST_F(ExportPredictionsTest, PointsHaveColoursAndNormalsAndCanBeThinned) {
  const std::string path = (folder_ / "a.ply").string();
  const std::vector<std::string> args = {"--image_path",
                                         (folder_ / "photos").string(),
                                         "--keep_percent",
                                         "100",
                                         "--output_path",
                                         path};
  const ColmapRun run = Export(args);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("2304 points with colours, normals"));
  EXPECT_THAT(ReadFile(path), HasSubstr("property float nz\n"));
  const std::vector<ColoredPoint> all = ReadPly(path);
  ASSERT_EQ(all.size(), 3u * 32 * 24);
  EXPECT_EQ(all[0].rgb, (Rgb{200, 100, 50}));
  EXPECT_NEAR(all[0].xyz.z(), kWallDepth, 1e-6);
  std::vector<std::string> thin = args;
  thin.insert(thin.end(), {"--voxel_size", "0.5", "--overwrite"});
  ASSERT_EQ(Export(thin).exit_code, 0);
  // The extent is 1: cubes of 0.5 over 6.2 x 4.
  EXPECT_LT(ReadPly(path).size(), 150u);
  EXPECT_GT(ReadPly(path).size(), 90u);
}

TEST_F(ExportPredictionsTest, GlbHoldsPointsAndCamerasWhereItsLibraryIs) {
  const std::string path = (folder_ / "a.glb").string();
  const ColmapRun run = Export({"--format", "glb", "--keep_percent", "100", "--output_path", path});
  if (!CanWriteGlb()) {
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.output, HasSubstr("libtinygltf-dev"));
    return;
  }
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("2304 points with colours, 3 cameras"));
  const std::string glb = ReadFile(path);
  EXPECT_TRUE(glb.starts_with("glTF"));
  EXPECT_THAT(glb, HasSubstr("\"name\":\"c.png\""));
}

TEST_F(ExportPredictionsTest, DepthMapsLieWhereColmapLooksForThem) {
  const std::string model = (folder_ / "seed").string();
  const std::string dense = (folder_ / "dense").string();
  ASSERT_EQ(RunVgtw({"seed", "--predictions_path", predictions_, "--output_path", model}).exit_code,
            0);
  const std::vector<std::string> args = {"--format", "colmap_depth", "--output_path", dense};
  const ColmapRun without = Export(args);
  EXPECT_EQ(without.exit_code, 1);
  EXPECT_THAT(without.output, HasSubstr("--model_path"));
  std::vector<std::string> with = args;
  with.insert(with.end(), {"--model_path", model, "--keep_percent", "100"});
  const ColmapRun run = Export(with);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("written: 3 depth maps in"));
  const ColmapMap depth = ReadColmapMap(folder_ / "dense/stereo/depth_maps/b.png.geometric.bin");
  EXPECT_EQ(depth.width, 64);
  EXPECT_NEAR(depth.At(10, 10, 0), kWallDepth, 1e-4);
  EXPECT_EQ(ReadColmapMap(folder_ / "dense/stereo/normal_maps/b.png.geometric.bin").num_channels,
            3);
  const ColmapRun again = Export(with);
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.output, HasSubstr("--overwrite"));
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
