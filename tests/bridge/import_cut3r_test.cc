// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/bridge/import_case.h"
#include "tests/bridge/numpy_files.h"

#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// Photos of 64x48 through DUSt3R's loader at 32: resized to 32x24, rows 4 to 19 kept.
constexpr size_t kNumPixels = 32 * 16;
constexpr size_t kNumFrames = 3;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Rigid3d WorldFromCam(size_t frame) {
  const auto i = static_cast<double>(frame);
  return {RotationAboutAxis(Eigen::Vector3d(1, 2 - i, 0.5).normalized(), 20.0 + 40.0 * i),
          {0.1 * i, -0.25, 1.0 / 3.0 + i}};
}

std::vector<float> PoseValues(size_t frame) {
  Eigen::Matrix<float, 4, 4, Eigen::RowMajor> pose = decltype(pose)::Identity();
  pose.topRows<3>() = WorldFromCam(frame).ToMatrix().cast<float>();
  return {pose.data(), pose.data() + 16};
}

std::vector<float> DepthValues(size_t frame) {
  std::vector<float> depth(kNumPixels);
  for (size_t k = 0; k < depth.size(); ++k) depth[k] = 1.0f + 0.1f * static_cast<float>(k + frame);
  return depth;
}

struct Case : ImportCase {
  Case() : ImportCase("demo_tmp") {
    WritePhotos(photos, {"frame_08.png", "frame_09.png", "frame_10.png"}, 64, 48);
    for (const char* name : {"camera", "depth", "conf", "color"}) {
      fs::create_directories(input / name);
    }
    for (size_t i = 0; i < kNumFrames; ++i) {
      const std::string number = "00000" + std::to_string(i);
      WriteCamera(i, PoseValues(i));
      Write("depth/" + number + ".npy", NpyFloats("(16, 32)", DepthValues(i)));
      Write("conf/" + number + ".npy",
            NpyFloats("(16, 32)", std::vector<float>(kNumPixels, 1.5f + static_cast<float>(i))));
      WriteImage(input / "color" / (number + ".png"), RgbImage(32, 16));
    }
  }
  void WriteCamera(size_t frame,
                   const std::vector<float>& pose,
                   const std::string& shape = "(4, 4)",
                   float focal = 30.5f) const {
    WriteNpz(input / "camera" / ("00000" + std::to_string(frame) + ".npz"),
             {{"pose", NpyFloats(shape, pose)},
              {"intrinsics", NpyFloats("(3, 3)", {focal, 0, 16, 0, focal, 8, 0, 0, 1})}});
  }
};

TEST(ImportCut3r, PosesDepthsAndCamerasAreThoseOfTheFiles) {
  Case test;
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kCut3r);
  EXPECT_EQ(summary.resize, ImportResize::kCrop);
  EXPECT_TRUE(summary.warnings.empty());
  const Prediction prediction = ReadPrediction(test.output);
  ASSERT_EQ(prediction.views.size(), kNumFrames);
  for (size_t i = 0; i < kNumFrames; ++i) {
    const ViewPrediction& view = prediction.views[i];
    const Rigid3d truth = Inverse(WorldFromCam(i));
    // The files hold float: 6e-8 relative.
    EXPECT_LT((view.view.cam_from_world.ToMatrix() - truth.ToMatrix()).norm(), 1e-6);
    EXPECT_EQ(view.depth.data(), DepthValues(i));
    EXPECT_EQ(view.depth_conf(9, 9), 1.5f + static_cast<float>(i));
    // The scale is 2; four rows were cut, so that cy = (8 + 4) * 2.
    EXPECT_EQ(view.view.camera.params, (std::vector<double>{61, 61, 32, 24}));
  }
  EXPECT_EQ(prediction.views[2].view.name, "frame_10.png");
}

TEST(ImportCut3r, CamerasAloneTellTheSizeByTheirMiddle) {
  Case test;
  fs::remove_all(test.input / "depth");
  fs::remove_all(test.input / "conf");
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.num_views_with_depth, 0u);
  EXPECT_EQ(ReadPrediction(test.output).views[1].view.camera.params,
            (std::vector<double>{61, 61, 32, 24}));
}

TEST(ImportCut3r, MissingFramesAreNamed) {
  for (const std::string name : {"depth/000001.npy", "conf/000000.npy"}) {
    Case test;
    fs::remove(test.input / name);
    ExpectHas(test.Message(), name);
  }
  // As many as photos, but numbered with a gap.
  Case gap;
  fs::rename(gap.input / "camera/000001.npz", gap.input / "camera/000007.npz");
  ExpectHas(gap.Message(), "camera/000001.npz: is missing");
  Case fewer;
  fs::remove(fewer.input / "camera/000002.npz");
  ExpectHas(fewer.Message(), "holds 2 cameras, expected one for each of the 3 photos");
}

TEST(ImportCut3r, WrongShapesAreNamed) {
  Case pose;
  pose.WriteCamera(1, {1, 0, 0, 0, 1, 0, 0, 0, 1}, "(3, 3)");
  ExpectHas(pose.Message(), "000001.npz:pose: has shape (3, 3)");
  Case several;
  several.WriteCamera(0, std::vector<float>(32, 0.0f), "(2, 4, 4)");
  EXPECT_NE(several.Message(), "");
  Case depth;
  depth.Write("depth/000002.npy", NpyFloats("(16, 16)", std::vector<float>(256, 1.0f)));
  ExpectHas(depth.Message(), "16x16 for frame_10.png of 64x48");
  Case conf;
  conf.Write("conf/000002.npy", NpyFloats("(16, 16)", std::vector<float>(256, 1.0f)));
  ExpectHas(conf.Message(), "expected 32x16");
  Case damaged;
  damaged.Write("camera/000001.npz", "no archive");
  ExpectHas(damaged.Message(), "000001.npz");
}

TEST(ImportCut3r, UnusableCamerasAreLeftOut) {
  Case test;
  std::vector<float> pose = PoseValues(0);
  pose[3] = kNan;
  test.WriteCamera(0, pose);
  test.WriteCamera(2, PoseValues(2), "(4, 4)", -1.0f);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.num_views, 1u);
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "2 views are left out");
  Case sheared;
  pose = PoseValues(0);
  pose[0] += 0.5f;
  sheared.WriteCamera(0, pose);
  ExpectHas(sheared.Message(), "no rotation");
}

}  // namespace
}  // namespace vgtw
