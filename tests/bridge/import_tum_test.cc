// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// 90 degrees around z: x_in_world = (-y, x, z) + t.
constexpr const char* kTurned = " 1 2 3 0 0 0.70710678118654752 0.70710678118654752\n";

struct Case {
  TemporaryFolder folder;
  explicit Case(const std::string& text) {
    WritePhotos(folder / "photos", {"a.png", "b.png", "c.png"}, 40, 30);
    WriteFileAtomically(folder / "poses.txt", text);
  }
  ImportSummary Run(const ImportOptions& options = {}) {
    return Import(folder / "poses.txt", folder / "photos", folder / "out", options);
  }
};

const std::string kIdentity = " 0 0 0 0 0 0 1\n";

TEST(ImportTum, TimestampsFollowTheOrderOfThePhotos) {
  Case test("1.0" + kIdentity + "2.0" + kTurned + "3.5" + kIdentity);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kTum);
  ASSERT_EQ(summary.warnings.size(), 1u);
  EXPECT_NE(summary.warnings[0].find("--camera_params"), std::string::npos);
  const View view = ReadPrediction(test.folder / "out").views[1].view;
  EXPECT_EQ(view.name, "b.png");
  EXPECT_EQ(view.camera.params, (std::vector<double>{48, 48, 20, 15}));
  // The camera's centre is the translation of the file.
  EXPECT_LT((OriginInSource(view.cam_from_world) - Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  // A world point (1, 2 + 5, 3) is 5 along the camera's x axis.
  EXPECT_LT((view.cam_from_world * Eigen::Vector3d(1, 7, 3) - Eigen::Vector3d(5, 0, 0)).norm(),
            1e-12);
}

TEST(ImportTum, NamesSelectPhotos) {
  Case test("c" + kIdentity + "a.png" + kTurned);
  const ImportSummary summary = test.Run({.camera_params = "100"});
  EXPECT_EQ(summary.num_views, 2u);
  EXPECT_TRUE(summary.warnings.empty());
  EXPECT_EQ(summary.notes.size(), 1u);
  const Prediction prediction = ReadPrediction(test.folder / "out");
  EXPECT_EQ(prediction.views[0].view.name, "a.png");
  EXPECT_EQ(prediction.views[1].view.name, "c.png");
  EXPECT_GT(OriginInSource(prediction.views[0].view.cam_from_world).norm(), 3.0);
}

TEST(ImportTum, CountsAndOrderMustFit) {
  Case fewer("1" + kIdentity + "2" + kIdentity);
  EXPECT_THROW(fewer.Run(), Error);
  Case decreasing("1" + kIdentity + "3" + kIdentity + "2" + kIdentity);
  EXPECT_THROW(decreasing.Run(), Error);
  Case unknown("a.png" + kIdentity + "x.png" + kIdentity);
  EXPECT_THROW(unknown.Run(), Error);
  Case traversal("../photos/../../a.png" + kIdentity + "../secret" + kIdentity);
  EXPECT_THROW(traversal.Run(), Error);
}

}  // namespace
}  // namespace vgtw
