// SPDX-License-Identifier: BSD-3-Clause
// The real colmap reads the models that bridge/colmap_model writes and the other way round.
#include "tests/support/colmap.h"

#include "bridge/colmap_model.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

namespace fs = std::filesystem;

// Runs model_converter; the output folder is made first because COLMAP wants it.
void Convert(const fs::path& executable,
             const fs::path& input,
             const fs::path& output,
             const std::string& format) {
  fs::create_directory(output);
  const ColmapRun run = RunColmap({"model_converter",
                                   "--input_path",
                                   input.string(),
                                   "--output_path",
                                   output.string(),
                                   "--output_type",
                                   format},
                                  executable);
  ASSERT_EQ(run.exit_code, 0) << run.output;
}

void ExpectSameModel(const Reconstruction& a, const Reconstruction& b) {
  // COLMAP normalises quaternions again, which moves the last bits of a unit one.
  constexpr double kRounding = 1e-15;
  EXPECT_EQ(a.cameras, b.cameras);
  ASSERT_EQ(a.images.size(), b.images.size());
  for (const auto& [image_id, image] : a.images) {
    const Image& other = b.images.at(image_id);
    EXPECT_EQ(image.name, other.name);
    EXPECT_EQ(image.camera_id, other.camera_id);
    EXPECT_EQ(image.points2D, other.points2D);
    EXPECT_LE((image.cam_from_world.rotation.coeffs() - other.cam_from_world.rotation.coeffs())
                  .cwiseAbs()
                  .maxCoeff(),
              kRounding);
    EXPECT_EQ(image.cam_from_world.translation, other.cam_from_world.translation);
  }
  ASSERT_EQ(a.points3D.size(), b.points3D.size());
  for (const auto& [point3D_id, point] : a.points3D) {
    const Point3D& other = b.points3D.at(point3D_id);
    EXPECT_EQ(point.xyz, other.xyz);
    EXPECT_EQ(point.rgb, other.rgb);
    EXPECT_EQ(point.error, other.error);
    EXPECT_EQ(point.track, other.track);
  }
}

// What `executable` makes of our files, in both formats, is what we wrote.
void ExpectColmapAgrees(const fs::path& executable, const Reconstruction& model) {
  const TemporaryFolder folder;
  WriteModel(model, folder / "binary");
  WriteModel(model, folder / "text", {ModelFormat::kText, false});
  Convert(executable, folder / "binary", folder / "text_by_colmap", "TXT");
  Convert(executable, folder / "text", folder / "binary_by_colmap", "BIN");
  ExpectSameModel(ReadModel(folder / "text_by_colmap"), model);
  ExpectSameModel(ReadModel(folder / "binary_by_colmap"), model);
}

TEST(ColmapModelByColmap, ConverterKeepsOurModel) {
  VGTW_NEED_COLMAP();
  ExpectColmapAgrees(ColmapExecutable(), SampleModel());
}

TEST(ColmapModelByColmap, AnalyzerCountsOurModel) {
  VGTW_NEED_COLMAP();
  const TemporaryFolder folder;
  WriteModel(SampleModel(), folder / "model");
  const ColmapRun run = RunColmap({"model_analyzer", "--path", (folder / "model").string()});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.output, HasSubstr("Cameras: 2"));
  EXPECT_THAT(run.output, HasSubstr("Images: 3"));
  EXPECT_THAT(run.output, HasSubstr("Points: 2"));
  EXPECT_THAT(run.output, HasSubstr("Observations: 4"));
  EXPECT_THAT(run.output, HasSubstr("Mean track length: 2.0"));
}

TEST(ColmapModelByColmap, RealModelSurvivesColmap) {
  VGTW_NEED_COLMAP();
  VGTW_NEED_SHARED_DATA();
  ExpectColmapAgrees(ColmapExecutable(), ReadModel(SharedData() / "wild/corner/reference"));
}

TEST(ColmapModelByColmap, OtherVersionKeepsOurModel) {
  VGTW_NEED_OTHER_COLMAP();
  ExpectColmapAgrees(OtherColmapExecutable(), SampleModel());
}

TEST(ColmapModelByColmap, OtherVersionKeepsOurRigs) {
  VGTW_NEED_OTHER_COLMAP();
  const TemporaryFolder folder;
  // Every sensor of a frame of COLMAP's own models is a camera with an image.
  Reconstruction model = SampleModelWithRigs();
  model.rigs.at(1).sensor_from_rig.erase({1, 1});
  model.frames.at(1).data.pop_back();
  ExpectColmapAgrees(OtherColmapExecutable(), model);
  WriteModel(model, folder / "binary");
  Convert(OtherColmapExecutable(), folder / "binary", folder / "text", "TXT");
  const Reconstruction read = ReadModel(folder / "text");
  if (read.frames.empty()) GTEST_SKIP() << "this COLMAP is older than rigs (3.12)";
  EXPECT_EQ(read.frames.size(), 2u);
  const auto& sensors = read.rigs.at(1).sensor_from_rig;
  ASSERT_EQ(sensors.size(), 1u);
  EXPECT_EQ(sensors.begin()->first, (SensorId{0, 7}));
  // The converter prints 17 digits, so that only its own normalisation can differ.
  EXPECT_LT((sensors.begin()->second->ToMatrix() -
             model.rigs.at(1).sensor_from_rig.at({0, 7})->ToMatrix())
                .norm(),
            1e-15);
}

}  // namespace
}  // namespace vgtw
