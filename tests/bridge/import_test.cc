// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"

#include "bridge/colmap_model.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

const std::string kTrajectory = "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n";

struct Case {
  TemporaryFolder folder;
  fs::path photos = folder / "photos";
  fs::path output = folder / "out";
  Case() {
    WritePhotos(photos, {"a.png", "b.png"}, 40, 30);
    WriteFileAtomically(folder / "poses.txt", kTrajectory);
  }
  ImportSummary Run(const fs::path& input, const ImportOptions& options = {}) {
    return Import(input, photos, output, options);
  }
  std::string Message(const fs::path& input, const ImportOptions& options = {}) {
    try {
      Run(input, options);
    } catch (const Error& error) {
      EXPECT_FALSE(fs::exists(output));
      return error.what();
    }
    return "";
  }
};

TEST(Import, UnknownInputsListTheFormats) {
  Case test;
  WriteFileAtomically(test.folder / "notes.txt", "nothing of use\n");
  WriteFileAtomically(test.folder / "empty", "");
  fs::create_directories(test.folder / "folder");
  for (const char* name : {"notes.txt", "empty", "folder", "missing"}) {
    const std::string message = test.Message(test.folder / name);
    EXPECT_NE(message.find("poses_bounds.npy"), std::string::npos) << message;
    EXPECT_NE(message.find("vggt_npz"), std::string::npos);
  }
}

TEST(Import, FilesWithoutCamerasTellWhatToSave) {
  Case test;
  WriteFileAtomically(test.folder / "pi3.ply", "ply\n");
  WriteFileAtomically(test.folder / "scene.glb", "glTF");
  WriteFileAtomically(test.folder / "scene.pth", "PK");
  for (const char* name : {"pi3.ply", "scene.glb"}) {
    const std::string message = test.Message(test.folder / name);
    EXPECT_NE(message.find("tells no camera"), std::string::npos) << message;
    EXPECT_NE(message.find("camera_poses"), std::string::npos) << message;
  }
  const std::string message = test.Message(test.folder / "scene.pth");
  EXPECT_NE(message.find("numpy.savez"), std::string::npos) << message;
}

TEST(Import, TwoFormatsInOneFolderNeedADecision) {
  Case test;
  const fs::path scene = test.folder / "scene";
  Reconstruction model = MakeSyntheticModel({.num_images = 2});
  model.images.begin()->second.name = "a.png";
  std::prev(model.images.end())->second.name = "b.png";
  fs::create_directories(scene);
  WriteModel(model, scene / "sparse");
  WriteNpz(scene / "predictions.npz",
           {{"extrinsic", NpyFloats("(2, 3, 4)", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0,  //
                                                  1, 0, 0, 4, 0, 1, 0, 5, 0, 0, 1, 6})}});
  const std::string message = test.Message(scene);
  EXPECT_NE(message.find("--format"), std::string::npos) << message;
  test.Run(scene, {.format = ImportFormat::kVggtNpz});
  EXPECT_EQ(ReadPrediction(test.output).views[1].view.cam_from_world.translation,
            Eigen::Vector3d(4, 5, 6));
}

TEST(Import, AWrongFormatIsNamed) {
  Case test;
  const std::string message =
      test.Message(test.folder / "poses.txt", {.format = ImportFormat::kColmap});
  EXPECT_NE(message.find("is no colmap"), std::string::npos) << message;
}

TEST(Import, ExistingOutputIsKeptUnlessOverwritten) {
  Case test;
  test.Run(test.folder / "poses.txt");
  const auto before = Snapshot(test.output);
  WriteFileAtomically(test.folder / "poses.txt", "1 9 9 9 0 0 0 1\n2 1 0 0 0 0 0 1\n");
  EXPECT_THROW(test.Run(test.folder / "poses.txt"), Error);
  EXPECT_EQ(Snapshot(test.output), before);
  test.Run(test.folder / "poses.txt", {.overwrite = true});
  EXPECT_EQ(ReadPrediction(test.output).views[0].view.cam_from_world.translation,
            Eigen::Vector3d(-9, -9, -9));
}

TEST(Import, MissingOrDamagedPhotosAreErrors) {
  Case test;
  EXPECT_THROW(Import(test.folder / "poses.txt", test.folder / "none", test.output, {}), Error);
  WriteFileAtomically(test.photos / "b.png", "no image");
  EXPECT_NE(test.Message(test.folder / "poses.txt").find("b.png"), std::string::npos);
}

TEST(Import, ProgressCountsViews) {
  Case test;
  std::vector<int64_t> calls;
  Import(test.folder / "poses.txt", test.photos, test.output, {}, [&](int64_t done, int64_t total) {
    calls.insert(calls.end(), {done, total});
  });
  EXPECT_EQ(calls, (std::vector<int64_t>{1, 2, 2, 2}));
}

TEST(Import, RepairsAreApplied) {
  Case test;
  test.Run(test.folder / "poses.txt", {.repair = {.invert_poses = true}});
  // The file says world_from_cam; inverted, its numbers are cam_from_world.
  EXPECT_EQ(ReadPrediction(test.output).views[1].view.cam_from_world.translation,
            Eigen::Vector3d(1, 0, 0));
}

}  // namespace
}  // namespace vgtw
