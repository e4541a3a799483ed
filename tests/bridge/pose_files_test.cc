// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/pose_files.h"

#include "bridge/colmap_model.h"
#include "bridge/predictions.h"
#include "scene/files.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// The camera at (1, 2, 3), turned by 90 deg around z, in each of the text formats.
const Eigen::Vector3d kCentre(1, 2, 3);
const std::string kTum = " 1 2 3 0 0 0.70710678118654752 0.70710678118654752\n";
const std::string kKitti = "0 -1 0 1 1 0 0 2 0 0 1 3\n";
// With y and z of the camera reversed.
const std::string kTransforms =
    R"({"frames": [{"file_path": "./b10.png",
                    "transform_matrix": [[0,1,0,1],[1,0,0,2],[0,0,-1,3],[0,0,0,1]]},
                   {"file_path": "./b9.png",
                    "transform_matrix": [[0,1,0,1],[1,0,0,2],[0,0,-1,3],[0,0,0,1]]}]})";

void ExpectTurned(const Rigid3d& cam_from_world) {
  EXPECT_LT((OriginInSource(cam_from_world) - kCentre).norm(), 1e-12);
  // The camera's x axis is the world's y axis.
  const Eigen::Vector3d point = cam_from_world * (kCentre + Eigen::Vector3d(0, 5, 0));
  EXPECT_LT((point - Eigen::Vector3d(5, 0, 0)).norm(), 1e-12);
}

class PoseFiles : public testing::Test {
 protected:
  PoseSet Read(const std::string& text, const ConventionRepair& repair = {}) const {
    WriteFileAtomically(folder_ / "poses", text);
    return ReadPoseSet(folder_ / "poses", repair);
  }
  const TemporaryFolder folder_;
};

TEST_F(PoseFiles, EveryTextFormatGivesTheSameCamera) {
  ExpectTurned(Read("0.5" + kTum).poses.at(0).cam_from_world);
  ExpectTurned(Read(kKitti).poses.at(0).cam_from_world);
  ExpectTurned(Read(kTransforms).poses.at(0).cam_from_world);
}

TEST_F(PoseFiles, OrderIsThatOfNumbersInNamesOfTimesOrOfLines) {
  const PoseSet named = Read(kTransforms);
  EXPECT_EQ(named.format, PoseFormat::kTransforms);
  EXPECT_EQ(named.key, PoseKey::kImageName);
  EXPECT_EQ(named.poses[0].name, "b9.png");
  EXPECT_EQ(named.poses[1].name, "b10.png");

  const PoseSet times = Read("10.5" + kTum + "9.25" + kTum);
  EXPECT_EQ(times.format, PoseFormat::kTum);
  EXPECT_EQ(times.key, PoseKey::kTimestamp);
  EXPECT_EQ(times.times_sec, (std::vector<double>{9.25, 10.5}));
  EXPECT_EQ(times.poses[0].name, "9.25");

  EXPECT_EQ(Read("a.png" + kTum + "7" + kTum).key, PoseKey::kImageName);

  const PoseSet lines = Read(kKitti + kKitti);
  EXPECT_EQ(lines.format, PoseFormat::kKitti);
  EXPECT_EQ(lines.key, PoseKey::kLine);
  EXPECT_EQ(lines.poses[1].name, "1");
}

TEST_F(PoseFiles, FoldersAreModelsPredictionsOrTransforms) {
  const Reconstruction model = SampleModel();
  WriteModel(model, folder_ / "sparse");
  const PoseSet colmap = ReadPoseSet(folder_ / "sparse");
  EXPECT_EQ(colmap.format, PoseFormat::kColmap);
  const auto expected = CamFromWorldByName(model);
  ASSERT_EQ(colmap.poses.size(), expected.size());
  for (const NamedPose& pose : colmap.poses) {
    EXPECT_EQ(pose.cam_from_world.ToMatrix(), expected.at(pose.name).ToMatrix());
  }

  std::filesystem::create_directory(folder_ / "scene");
  WriteFileAtomically(folder_ / "scene/transforms.json", kTransforms);
  EXPECT_EQ(ReadPoseSet(folder_ / "scene").format, PoseFormat::kTransforms);

  Prediction prediction;
  prediction.views.resize(1);
  View& view = prediction.views[0].view;
  view.name = "a.jpg";
  view.camera = MakePinhole(40, 30, 50.0, 50.0);
  view.cam_from_world.translation = {1, 2, 3};
  WritePrediction(prediction, folder_ / "predictions", false);
  const PoseSet predictions = ReadPoseSet(folder_ / "predictions");
  EXPECT_EQ(predictions.format, PoseFormat::kPredictions);
  EXPECT_EQ(predictions.poses.at(0).cam_from_world.translation, view.cam_from_world.translation);
}

TEST_F(PoseFiles, RepairsAreThoseOfImport) {
  const Rigid3d inverted = Read("1" + kTum, {.invert_poses = true}).poses[0].cam_from_world;
  EXPECT_LT((inverted.translation - kCentre).norm(), 1e-12);
  const std::string wxyz = "1 1 2 3 0.70710678118654752 0 0 0.70710678118654752\n";
  ExpectTurned(Read(wxyz, {.swap_quaternion_order = true}).poses[0].cam_from_world);
  const std::string message = ErrorOf([&] { Read(kKitti, {.swap_quaternion_order = true}); });
  EXPECT_NE(message.find("matrices"), std::string::npos) << message;
}

TEST_F(PoseFiles, ReadPosesNeedsImageNames) {
  WriteFileAtomically(folder_ / "named", "a.png" + kTum);
  ExpectTurned(ReadPoses(folder_ / "named").at("a.png"));
  WriteFileAtomically(folder_ / "timed", "1.5" + kTum);
  EXPECT_NE(ErrorOf([&] { ReadPoses(folder_ / "timed"); }).find("image names"), std::string::npos);
}

TEST_F(PoseFiles, WhatIsNotUsableIsAnError) {
  EXPECT_NE(ErrorOf([&] { ReadPoseSet(folder_ / "nothing"); }).find("does not exist"),
            std::string::npos);
  EXPECT_NE(ErrorOf([&] { ReadPoseSet(folder_.path()); }), "");
  EXPECT_NE(ErrorOf([&] { Read("no poses here\n"); }), "");
  EXPECT_NE(ErrorOf([&] { Read(""); }), "");
  EXPECT_NE(ErrorOf([&] { Read("{\"views\": []}"); }), "");
  EXPECT_NE(ErrorOf([&] { Read("a.png" + kTum + "a.png" + kTum); }).find("twice"),
            std::string::npos);
  EXPECT_NE(ErrorOf([&] { Read("1.0" + kTum + "1.00" + kTum); }).find("time"), std::string::npos);
}

}  // namespace
}  // namespace vgtw
