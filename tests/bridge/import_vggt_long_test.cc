// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/import_case.h"
#include "tests/bridge/numpy_files.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// 90 degrees around z: x_in_world = (-y, x, z) + (1, 2, 3).
const std::string kTurned = "0.0 -1.0 0.0 1.0 1.0 0.0 0.0 2.0 0.0 0.0 1.0 3.0 0.0 0.0 0.0 1.0\n";
const std::string kIdentity = "1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0\n";

// Photos of 56x28, which VGGT's loader takes to 28x14 at a width of 28.
struct Case : ImportCase {
  Case() : ImportCase("exp") {
    WritePhotos(photos, {"a.png", "b.png"}, 56, 28);
    fs::create_directories(input);
    Write("camera_poses.txt", kIdentity + kTurned);
    Write("intrinsic.txt", "30.5 31.0 14.0 7.0\n32.0 33.0 14.0 7.0\n");
    Write("camera_poses.ply", "ply\n");
  }
  View ReadSecond() { return ReadPrediction(output).views[1].view; }
};

TEST(ImportVggtLong, MatricesAreWorldFromCam) {
  for (const bool by_file : {false, true}) {
    Case test;
    // The end of a matrix would pass for a TUM pose without rotation.
    if (by_file) test.input = test.input / "camera_poses.txt";
    const ImportSummary summary = test.Run();
    EXPECT_EQ(summary.format, ImportFormat::kVggtLong);
    EXPECT_EQ(summary.num_views, 2u);
    EXPECT_TRUE(summary.warnings.empty());
    const View view = test.ReadSecond();
    EXPECT_LT((OriginInSource(view.cam_from_world) - Eigen::Vector3d(1, 2, 3)).norm(), 1e-9);
    // A world point (1, 2 + 5, 3) is 5 along the camera's x axis.
    EXPECT_LT((view.cam_from_world * Eigen::Vector3d(1, 7, 3) - Eigen::Vector3d(5, 0, 0)).norm(),
              1e-9);
  }
}

TEST(ImportVggtLong, IntrinsicsAreBroughtToOriginalPixels) {
  Case test;
  EXPECT_EQ(test.Run().resize, ImportResize::kCrop);
  EXPECT_EQ(test.ReadSecond().camera.params, (std::vector<double>{64, 66, 28, 14}));
}

TEST(ImportVggtLong, CameraParametersStandInForIntrinsics) {
  Case given;
  EXPECT_TRUE(given.Run({.camera_params = "50"}).warnings.empty());
  EXPECT_EQ(given.ReadSecond().camera.params, (std::vector<double>{50, 50, 28, 14}));
  Case pi3;
  fs::remove(pi3.input / "intrinsic.txt");
  const ImportSummary summary = pi3.Run();
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "--camera_params");
}

TEST(ImportVggtLong, DamagedFilesAreNamed) {
  Case fewer;
  fewer.Write("camera_poses.txt", kIdentity);
  ExpectHas(fewer.Message(), "1 poses");
  Case nan;
  nan.Write("camera_poses.txt", kIdentity + "nan" + kTurned.substr(3));
  ExpectHas(nan.Message(), "line 2");
  Case scaled;
  scaled.Write("camera_poses.txt", kIdentity + "0.0 -2.0" + kTurned.substr(8));
  ExpectHas(scaled.Message(), "no rotation");
  Case transposed;
  transposed.Write("camera_poses.txt", kIdentity + "1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1\n");
  ExpectHas(transposed.Message(), "last row");
  Case lines;
  lines.Write("intrinsic.txt", "30 30 14 7\n");
  ExpectHas(lines.Message(), "1 lines of intrinsics");
  Case off_centre;
  off_centre.Write("intrinsic.txt", "30 30 14 7\n30 30 14.2 7\n");
  ExpectHas(off_centre.Message(), "--camera_params");
}

}  // namespace
}  // namespace vgtw
