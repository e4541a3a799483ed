// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "tests/bridge/import_case.h"
#include "tests/bridge/numpy_files.h"

#include <cmath>
#include <cstdio>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// Photos of 64x48 through DUSt3R's loader at 32: resized to 32x24, rows 4 to 19 kept.
constexpr int kWidth = 32;
constexpr int kHeight = 16;
constexpr size_t kNumFrames = 3;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Rigid3d Truth(size_t frame) {
  const auto i = static_cast<double>(frame);
  return {RotationAboutAxis(Eigen::Vector3d(1, 2 - i, 0.5).normalized(), 20.0 + 40.0 * i),
          {0.1 * i, -0.25, 1.0 / 3.0 + i}};
}

std::vector<float> TrueDepth(size_t frame) {
  std::vector<float> depth(kWidth * kHeight);
  for (size_t k = 0; k < depth.size(); ++k) {
    depth[k] = 1.0f + 0.1f * static_cast<float>(k) + static_cast<float>(frame);
  }
  return depth;
}

// As the writers' f-string of NumPy numbers: the shortest digits that read back the same.
std::string TrajectoryLine(size_t frame, bool scalar_last = false) {
  const Rigid3d pose = Truth(frame);
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  char line[400];
  std::snprintf(line,
                sizeof(line),
                "%zu.0 %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n",
                frame,
                t.x(),
                t.y(),
                t.z(),
                scalar_last ? q.x() : q.w(),
                scalar_last ? q.y() : q.x(),
                scalar_last ? q.z() : q.y(),
                scalar_last ? q.w() : q.z());
  return line;
}

struct Case : ImportCase {
  Case() : ImportCase("davis") {
    WritePhotos(photos, {"00009.png", "00010.png", "00011.png"}, 64, 48);
    fs::create_directories(input);
    std::string trajectory;
    std::string intrinsics;
    for (size_t i = 0; i < kNumFrames; ++i) {
      trajectory += TrajectoryLine(i);
      intrinsics +=
          "30.500000 0.000000 16.000000 0.000000 30.500000 8.000000 0.000000 0.000000 "
          "1.000000\n";
      const std::string n = std::to_string(i);
      Write("frame_000" + n + ".npy", NpyFloats("(16, 32)", TrueDepth(i)));
      Write("conf_" + n + ".npy",
            NpyFloats("(16, 32)", std::vector<float>(kWidth * kHeight, 0.5f + 0.5f * (float)i)));
      GrayImage mask(kWidth, kHeight);
      mask(3, static_cast<int>(i)) = 255;
      WriteImage(input / ("dynamic_mask_" + n + ".png"), mask);
      WriteImage(input / ("frame_000" + n + ".png"), RgbImage(kWidth, kHeight));
      Write("init_conf_" + n + ".npy", NpyFloats("(1,)", {0}));
    }
    Write("pred_traj.txt", trajectory);
    Write("pred_intrinsics.txt", intrinsics);
  }
};

TEST(ImportMonst3r, PosesDepthsAndMasksAreThoseOfTheFiles) {
  Case test;
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kMonst3r);
  EXPECT_EQ(summary.resize, ImportResize::kCrop);
  EXPECT_EQ(summary.num_views_with_distractors, kNumFrames);
  EXPECT_TRUE(summary.warnings.empty());
  ASSERT_EQ(summary.notes.size(), 1u);
  ExpectHas(summary.notes[0], "order of their names");
  const Prediction prediction = ReadPrediction(test.output);
  ASSERT_EQ(prediction.views.size(), kNumFrames);
  EXPECT_EQ(prediction.views[0].view.name, "00009.png");
  for (size_t i = 0; i < kNumFrames; ++i) {
    const ViewPrediction& view = prediction.views[i];
    const Rigid3d truth = Inverse(Truth(i));
    EXPECT_LT((view.view.cam_from_world.ToMatrix() - truth.ToMatrix()).norm(), 1e-9);
    EXPECT_EQ(view.depth.data(), TrueDepth(i));
    EXPECT_EQ(view.depth_conf(7, 7), 0.5f + 0.5f * static_cast<float>(i));
    EXPECT_EQ(view.distractor(3, static_cast<int>(i)), 1.0f);
    EXPECT_EQ(view.distractor(4, static_cast<int>(i)), 0.0f);
  }
}

TEST(ImportMonst3r, CamerasAreInOriginalPixels) {
  Case test;
  test.Run();
  const View view = ReadPrediction(test.output).views[0].view;
  // The scale is 2; four rows of the network's 24 were cut, so that cy = (8 + 4) * 2.
  EXPECT_EQ(view.camera.params, (std::vector<double>{61, 61, 32, 24}));
  EXPECT_EQ(Apply(view.original_from_network, {0.5, 0.5}), Eigen::Vector2d(1, 9));
}

TEST(ImportMonst3r, TheTrajectoryAloneIsNotTakenForTum) {
  Case test;
  test.input = test.input / "pred_traj.txt";
  EXPECT_EQ(test.Run().format, ImportFormat::kMonst3r);
  const Rigid3d read = ReadPrediction(test.output).views[2].view.cam_from_world;
  EXPECT_LT(AngleBetweenDeg(read.rotation, Inverse(Truth(2)).rotation), 1e-6);
}

TEST(ImportMonst3r, RewrittenQuaternionsAreReadOnRequest) {
  Case test;
  test.Write("pred_traj.txt",
             TrajectoryLine(0, true) + TrajectoryLine(1, true) + TrajectoryLine(2, true));
  test.Run({.repair = {.swap_quaternion_order = true}});
  const Rigid3d read = ReadPrediction(test.output).views[1].view.cam_from_world;
  EXPECT_LT((read.ToMatrix() - Inverse(Truth(1)).ToMatrix()).norm(), 1e-9);
}

TEST(ImportMonst3r, UnusableDepthIsUnknown) {
  Case test;
  std::vector<float> depth = TrueDepth(1);
  depth[0] = kNan;
  depth[1] = 0.0f;
  depth[2] = -2.0f;
  depth[3] = std::numeric_limits<float>::infinity();
  test.Write("frame_0001.npy", NpyFloats("(16, 32)", depth));
  test.Run();
  const DepthMap read = ReadPrediction(test.output).views[1].depth;
  for (int x = 0; x < 4; ++x) EXPECT_TRUE(std::isnan(read(x, 0))) << x;
  EXPECT_EQ(read(4, 0), depth[4]);
}

TEST(ImportMonst3r, MasksAndConfidenceMayBeAbsent) {
  Case test;
  for (const char* name : {"conf_0.npy", "conf_1.npy", "conf_2.npy"}) fs::remove(test.input / name);
  for (size_t i = 0; i < kNumFrames; ++i) {
    fs::remove(test.input / ("dynamic_mask_" + std::to_string(i) + ".png"));
  }
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.num_views_with_distractors, 0u);
  EXPECT_EQ(summary.num_views_with_depth, kNumFrames);
  EXPECT_EQ(summary.notes.size(), 2u);
  EXPECT_TRUE(ReadPrediction(test.output).views[0].depth_conf.empty());
}

TEST(ImportMonst3r, MissingFramesAreNamed) {
  for (const std::string name :
       {"frame_0001.npy", "conf_0.npy", "conf_2.npy", "dynamic_mask_1.png"}) {
    Case test;
    fs::remove(test.input / name);
    ExpectHas(test.Message(), name);
  }
}

TEST(ImportMonst3r, ShapesMustFit) {
  const std::vector<float> small(16 * 16, 1.0f);
  Case depth;
  depth.Write("frame_0002.npy", NpyFloats("(16, 16)", small));
  ExpectHas(depth.Message(), "16x16 for 00011.png of 64x48");
  Case conf;
  conf.Write("conf_1.npy", NpyFloats("(16, 16)", small));
  ExpectHas(conf.Message(), "expected 32x16");
  Case mask;
  WriteImage(mask.input / "dynamic_mask_0.png", GrayImage(64, 48));
  ExpectHas(mask.Message(), "64x48");
  Case flat;
  flat.Write("frame_0000.npy", NpyFloats("(256,)", small));
  ExpectHas(flat.Message(), "(H, W)");
  Case photos;
  WritePhotos(photos.photos, {"00009.png", "00010.png", "00011.png"}, 64, 64);
  ExpectHas(photos.Message(), "DUSt3R's loader");
}

TEST(ImportMonst3r, CountsMustFit) {
  Case more_photos;
  WritePhotos(more_photos.photos, {"00012.png"}, 64, 48);
  ExpectHas(more_photos.Message(), "one for each of the 4 photos");
  Case fewer_intrinsics;
  fewer_intrinsics.Write("pred_intrinsics.txt", "1 0 1 0 1 1 0 0 1\n");
  ExpectHas(fewer_intrinsics.Message(), "1 lines of intrinsics");
}

TEST(ImportMonst3r, NumbersThatAreNotFiniteNameTheirLine) {
  Case poses;
  poses.Write("pred_traj.txt", TrajectoryLine(0) + "1.0 nan 0 0 1 0 0 0\n" + TrajectoryLine(2));
  ExpectHas(poses.Message(), "line 2");
  Case intrinsics;
  intrinsics.Write("pred_intrinsics.txt", "nan 0 16 0 30 8 0 0 1\n");
  ExpectHas(intrinsics.Message(), "line 1");
  Case zero_focal;
  zero_focal.Write("pred_intrinsics.txt",
                   "30 0 16 0 30 8 0 0 1\n0 0 16 0 0 8 0 0 1\n30 0 16 0 30 8 0 0 1\n");
  const ImportSummary summary = zero_focal.Run();
  EXPECT_EQ(summary.num_views, 2u);
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "00010.png");
}

// eval/relpose of CUT3R: the same trajectory, pred_focal.txt, pred_intrinsics.txt, no maps. The
// size is twice the principal point, the scale 2.
struct Cut3rCase : Case {
  Cut3rCase() {
    for (const fs::directory_entry& entry : fs::directory_iterator(input)) {
      if (entry.path().extension() != ".txt") fs::remove(entry.path());
    }
    Write("pred_focal.txt", "400.000000\n408.000000\n416.000000\n");
  }
  View ReadThird() const { return ReadPrediction(output).views[2].view; }
  void ExpectTruePose() const {
    const Eigen::Matrix<double, 3, 4> truth = Inverse(Truth(2)).ToMatrix();
    EXPECT_LT((ReadThird().cam_from_world.ToMatrix() - truth).norm(), 1e-9);
  }
};

TEST(ImportMonst3r, FoldersOfCut3rsEvaluationHoldPosesAlone) {
  Cut3rCase test;
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kMonst3r);
  EXPECT_EQ(summary.num_views_with_depth, 0u);
  EXPECT_TRUE(summary.warnings.empty());
  test.ExpectTruePose();
  EXPECT_EQ(test.ReadThird().camera.params, (std::vector<double>{61, 61, 32, 24}));
  Cut3rCase off_centre;
  off_centre.Write("pred_intrinsics.txt",
                   "30 0 16 0 30 8 0 0 1\n30 0 16.2 0 30 8 0 0 1\n30 0 16 0 30 8 0 0 1\n");
  ExpectHas(off_centre.Message(), "principal point of camera 1");
}

// 64x48 becomes 512x384 by default: a scale of 1/8.
TEST(ImportMonst3r, FocalLengthsAloneAreOfTheLoadersDefaultSize) {
  Cut3rCase test;
  fs::remove(test.input / "pred_intrinsics.txt");
  const ImportSummary summary = test.Run();
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "512x384");
  test.ExpectTruePose();
  EXPECT_EQ(test.ReadThird().camera.params, (std::vector<double>{52, 52, 32, 24}));
  Cut3rCase given;
  fs::remove(given.input / "pred_intrinsics.txt");
  EXPECT_TRUE(given.Run({.camera_params = "70"}).warnings.empty());
  EXPECT_EQ(given.ReadThird().camera.params, (std::vector<double>{70, 70, 32, 24}));
  Cut3rCase fewer;
  fs::remove(fewer.input / "pred_intrinsics.txt");
  fewer.Write("pred_focal.txt", "400\n");
  ExpectHas(fewer.Message(), "1 focal lengths");
}

TEST(ImportMonst3r, ATrajectoryOfThatNameIsReadScalarFirst) {
  Cut3rCase test;
  fs::remove(test.input / "pred_intrinsics.txt");
  fs::remove(test.input / "pred_focal.txt");
  const ImportSummary summary = test.Run({.camera_params = "70"});
  EXPECT_EQ(summary.format, ImportFormat::kMonst3r);
  ASSERT_EQ(summary.notes.size(), 3u);
  ExpectHas(summary.notes[2], "--swap_quaternion_order");
  test.ExpectTruePose();
  // Who says so reads it as TUM.
  Cut3rCase tum;
  tum.input /= "pred_traj.txt";
  tum.Run({.format = ImportFormat::kTum, .camera_params = "70"});
  EXPECT_GT(AngleBetweenDeg(tum.ReadThird().cam_from_world.rotation, Inverse(Truth(2)).rotation),
            10.0);
}

TEST(ImportMonst3r, MasksNeedASize) {
  Case test;
  for (const char* name : {"frame_0000.npy",
                           "frame_0001.npy",
                           "frame_0002.npy",
                           "conf_0.npy",
                           "conf_1.npy",
                           "conf_2.npy",
                           "pred_intrinsics.txt"}) {
    fs::remove(test.input / name);
  }
  ExpectHas(test.Message(), "dynamic_mask_0.png: stands alone");
}

// Easi3R's demo leaves more masks and images in its folder.
TEST(ImportMonst3r, OtherFilesOfEasi3rDoNoHarm) {
  Case test;
  for (const char* name : {"frames_dynamic_masks", "frames_fused_dynamic_masks"}) {
    fs::create_directories(test.input / name);
    WriteImage(test.input / name / "frame_0000.png", RgbImage(64, 64));
  }
  for (size_t i = 0; i < kNumFrames; ++i) {
    const std::string n = std::to_string(i);
    WriteImage(test.input / ("enlarged_dynamic_mask_" + n + ".png"),
               GrayImage(kWidth, kHeight, 255));
  }
  test.Write("0_dynamic_masks.mp4", "");
  EXPECT_EQ(test.Run().num_views_with_distractors, kNumFrames);
  EXPECT_EQ(ReadPrediction(test.output).views[1].distractor(4, 1), 0.0f);
}

TEST(ImportMonst3r, StretchMeansARunWithoutCrop) {
  Case test;
  test.Run({.resize = ImportResize::kStretch});
  const View view = ReadPrediction(test.output).views[0].view;
  EXPECT_EQ(view.camera.params, (std::vector<double>{61, 91.5, 32, 24}));
  Case pad;
  ExpectHas(pad.Message({.resize = ImportResize::kPad}), "never pads");
}

}  // namespace
}  // namespace vgtw
