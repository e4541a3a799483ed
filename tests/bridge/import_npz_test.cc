// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/depth_map.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/numpy_files.h"
#include "tests/support/temporary_folder.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Arrays = std::map<std::string, std::string>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Photos of 56x28 in crop mode at a width of 28: maps of 28x14, a scale of exactly 2.
constexpr int kPhotoWidth = 56;
constexpr int kPhotoHeight = 28;
constexpr int kWidth = 28;
constexpr int kHeight = 14;
constexpr size_t kNumPixels = kWidth * kHeight;

std::vector<float> Constant(float first, float second) {
  std::vector<float> values(2 * kNumPixels, first);
  std::fill(values.begin() + kNumPixels, values.end(), second);
  return values;
}

const std::vector<float> kExtrinsics = {1, 0, 0, 0, 0, 1, 0, 0,  0,  0, 1, 0,   // identity
                                        0, 0, 1, 1, 0, 1, 0, -2, -1, 0, 0, 3};  // 90 deg around y
const std::vector<float> kIntrinsics = {30, 0, 14, 0, 31, 7, 0, 0, 1, 32, 0, 14, 0, 33, 7, 0, 0, 1};

// Two views as numpy.savez of VGTW's demo.
Arrays TwoViews() {
  return {{"extrinsic", NpyFloats("(2, 3, 4)", kExtrinsics)},
          {"intrinsic", NpyFloats("(2, 3, 3)", kIntrinsics)},
          {"depth", NpyFloats("(2, 14, 28, 1)", Constant(2, 4))},
          {"depth_conf", NpyFloats("(2, 14, 28)", Constant(1.5, 7))},
          {"depth_mask", NpyFloats("(2, 14, 28)", Constant(-3, 2))},
          {"depth_mask_binary", NpyFloats("(2, 14, 28)", Constant(0, 1))},
          {"images", NpyFloats("(1,)", {0})}};
}

struct Case {
  TemporaryFolder folder;
  fs::path photos = folder / "photos";
  fs::path input = folder / "predictions.npz";
  fs::path output = folder / "out";

  explicit Case(const Arrays& arrays, const std::vector<std::string>& names = {"a.png", "b.png"}) {
    WritePhotos(photos, names, kPhotoWidth, kPhotoHeight);
    WriteNpz(input, arrays);
  }
  ImportSummary Run(const ImportOptions& options = {}) {
    return Import(input, photos, output, options);
  }
  Prediction RunAndRead(const ImportOptions& options = {}) {
    Run(options);
    return ReadPrediction(output);
  }
  std::string Message(const ImportOptions& options = {}) {
    try {
      Run(options);
    } catch (const Error& error) {
      EXPECT_FALSE(fs::exists(output));
      return error.what();
    }
    return "";
  }
};

std::string MessageWith(const std::string& key, const std::string& npy) {
  Arrays arrays = TwoViews();
  arrays[key] = npy;
  return Case(arrays).Message();
}

TEST(ImportNpz, CamerasAndPosesAreInOriginalPixels) {
  Case test(TwoViews());
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kVggtNpz);
  EXPECT_EQ(summary.resize, ImportResize::kCrop);
  EXPECT_EQ(summary.num_views, 2u);
  EXPECT_EQ(summary.num_views_with_depth, 2u);
  EXPECT_EQ(summary.num_views_with_distractors, 2u);
  EXPECT_EQ(summary.num_views_with_samples, 0u);
  EXPECT_TRUE(summary.warnings.empty()) << summary.warnings[0];
  const Prediction prediction = ReadPrediction(test.output);
  EXPECT_EQ(prediction.producer, "import vggt_npz");
  const View& a = prediction.views[0].view;
  const View& b = prediction.views[1].view;
  EXPECT_EQ(a.name, "a.png");
  EXPECT_EQ(a.camera.params, (std::vector<double>{60, 62, 28, 14}));
  EXPECT_EQ(b.camera.params, (std::vector<double>{64, 66, 28, 14}));
  EXPECT_EQ(a.network_width, kWidth);
  EXPECT_EQ(a.network_height, kHeight);
  // x_in_cam = (z, y, -x) + t.
  const Eigen::Vector3d point = b.cam_from_world * Eigen::Vector3d(5, 6, 7);
  EXPECT_LT((point - Eigen::Vector3d(7 + 1, 6 - 2, -5 + 3)).norm(), 1e-12);
}

TEST(ImportNpz, DepthBelongsToPixelCentres) {
  Case test(TwoViews());
  const ViewPrediction view = test.RunAndRead().views[0];
  // Network pixel (0, 0): centre (0.5, 0.5), K = (30, 31, 14, 7), depth 2. VGGT's own script takes
  // (0, 0) and would give x = -14 * 2 / 30.
  const auto point = UnprojectPixel(view.view, view.depth, 0, 0);
  ASSERT_TRUE(point);
  EXPECT_NEAR(point->x(), -13.5 * 2 / 30, 1e-12);
  EXPECT_NEAR(point->y(), -6.5 * 2 / 31, 1e-12);
  EXPECT_NEAR(point->z(), 2.0, 1e-12);
  // COLMAP sees it at the centre of the 2x2 original pixels below that network pixel.
  const auto pixel = Project(view.view.camera, view.view.cam_from_world * *point);
  ASSERT_TRUE(pixel);
  EXPECT_LT((*pixel - Eigen::Vector2d(1.0, 1.0)).norm(), 1e-12);
}

TEST(ImportNpz, LogitsBecomeProbabilities) {
  Case test(TwoViews());
  const Prediction prediction = test.RunAndRead();
  // Stored as float16: 11 bits.
  EXPECT_NEAR(prediction.views[0].distractor(3, 3), 1 / (1 + std::exp(3.0)), 1e-4);
  EXPECT_NEAR(prediction.views[1].distractor(3, 3), 1 / (1 + std::exp(-2.0)), 1e-3);
  EXPECT_EQ(prediction.views[0].depth_conf(0, 0), 1.5f);
  EXPECT_EQ(prediction.views[1].depth(27, 13), 4.0f);
}

TEST(ImportNpz, BinaryMasksAreTakenWithoutLogits) {
  Arrays arrays = TwoViews();
  arrays.erase("depth_mask");
  Case binary(arrays);
  const Prediction prediction = binary.RunAndRead();
  EXPECT_EQ(prediction.views[0].distractor(0, 0), 0.0f);
  EXPECT_EQ(prediction.views[1].distractor(0, 0), 1.0f);
  // A mask of 0 and 1 under the name of the logits would become 0.5 and 0.73.
  arrays["depth_mask"] = NpyFloats("(2, 14, 28)", Constant(0, 1));
  Case disguised(arrays);
  const ImportSummary summary = disguised.Run();
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_NE(summary.notes[0].find("only 0 and 1"), std::string::npos);
  EXPECT_EQ(ReadPrediction(disguised.output).views[0].distractor(0, 0), 0.0f);
  EXPECT_EQ(ReadPrediction(disguised.output).views[1].distractor(0, 0), 1.0f);
}

TEST(ImportNpz, ABatchDimensionAndOtherTypesAreUnderstood) {
  Arrays arrays = TwoViews();
  arrays["extrinsics"] =
      NpyDoubles("(1, 2, 3, 4)", std::vector<double>(kExtrinsics.begin(), kExtrinsics.end()));
  arrays.erase("extrinsic");
  arrays["depth"] = NpyDoubles("(1, 2, 14, 28, 1)", std::vector<double>(2 * kNumPixels, 0.25));
  arrays["depth_mask"] =
      NpyBytes("|b1", "(1, 2, 14, 28)", std::string(kNumPixels, '\0') + std::string(kNumPixels, 1));
  Case test(arrays);
  const Prediction prediction = test.RunAndRead();
  EXPECT_EQ(prediction.views[1].depth(5, 5), 0.25f);
  EXPECT_EQ(prediction.views[1].distractor(5, 5), 1.0f);
  EXPECT_EQ(prediction.views[0].distractor(5, 5), 0.0f);
}

TEST(ImportNpz, UnknownDepthStaysUnknown) {
  Arrays arrays = TwoViews();
  std::vector<float> depth = Constant(2, 4);
  depth[0] = kNan;
  depth[1] = 0.0f;
  depth[2] = -1.0f;
  depth[3] = std::numeric_limits<float>::infinity();
  arrays["depth"] = NpyFloats("(2, 14, 28)", depth);
  Case test(arrays);
  const DepthMap read = test.RunAndRead().views[0].depth;
  for (int x = 0; x < 4; ++x) EXPECT_TRUE(std::isnan(read(x, 0))) << x;
  EXPECT_EQ(read(4, 0), 2.0f);
}

TEST(ImportNpz, WhatLiesOnPaddingIsUnknown) {
  // A second photo of 56x56 makes the batch 28x28: the first has 7 rows of padding on both sides.
  Arrays arrays = TwoViews();
  const std::vector<float> ones(2 * 28 * 28, 1.0f);
  for (const char* key : {"depth", "depth_conf", "depth_mask_binary"}) {
    arrays[key] = NpyFloats("(2, 28, 28)", ones);
  }
  arrays.erase("depth_mask");
  Case test(arrays);
  WritePhotos(test.photos, {"b.png"}, 56, 56);
  const ImportSummary summary = test.Run({.resize = ImportResize::kCrop});
  EXPECT_TRUE(summary.warnings.empty());
  const Prediction prediction = ReadPrediction(test.output);
  const ViewPrediction& padded = prediction.views[0];
  for (const int y : {0, 6, 21, 27}) {
    EXPECT_TRUE(std::isnan(padded.depth(5, y))) << y;
    EXPECT_TRUE(std::isnan(padded.depth_conf(5, y))) << y;
    EXPECT_TRUE(std::isnan(padded.distractor(5, y))) << y;
  }
  for (const int y : {7, 20}) EXPECT_EQ(padded.depth(5, y), 1.0f) << y;
  EXPECT_EQ(prediction.views[1].depth(5, 0), 1.0f);
  // cy: network 7 lies at original (7 - 7) * 2 = 0.
  EXPECT_EQ(padded.view.camera.PrincipalPoint().y(), 0.0);
}

TEST(ImportNpz, WorldPointsAreKept) {
  Arrays arrays = TwoViews();
  std::vector<float> points(2 * kNumPixels * 3);
  for (size_t i = 0; i < points.size(); ++i) points[i] = static_cast<float>(i);
  arrays["world_points"] = NpyFloats("(2, 14, 28, 3)", points);
  Case test(arrays);
  const Prediction prediction = test.RunAndRead();
  EXPECT_EQ(prediction.views[0].points(1, 0), Eigen::Vector3f(3, 4, 5));
  EXPECT_EQ(prediction.views[1].points(0, 0).x(), 3.0f * kNumPixels);
}

TEST(ImportNpz, PosesWithoutMapsNeedCameras) {
  Case test({{"extrinsic", NpyFloats("(2, 3, 4)", kExtrinsics)}});
  const Prediction prediction = test.RunAndRead({.camera_params = "50"});
  EXPECT_EQ(prediction.views[1].view.camera.params, (std::vector<double>{50, 50, 28, 14}));
  EXPECT_EQ(prediction.views[1].view.network_width, 0);
  EXPECT_TRUE(prediction.views[1].depth.empty());
  Case ambiguous({{"extrinsic", NpyFloats("(2, 3, 4)", kExtrinsics)},
                  {"intrinsic", NpyFloats("(2, 3, 3)", kIntrinsics)}});
  EXPECT_NE(ambiguous.Message().find("network pixels"), std::string::npos);
}

TEST(ImportNpz, ViewsWithoutAUsablePoseAreLeftOutWithAWarning) {
  Arrays arrays = TwoViews();
  std::vector<float> intrinsics = kIntrinsics;
  intrinsics[0] = std::numeric_limits<float>::infinity();  // a field of view of 0
  arrays["intrinsic"] = NpyFloats("(2, 3, 3)", intrinsics);
  Case test(arrays);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.num_views, 1u);
  ASSERT_EQ(summary.warnings.size(), 1u);
  EXPECT_NE(summary.warnings[0].find("a.png"), std::string::npos);
  EXPECT_EQ(ReadPrediction(test.output).views[0].depth(0, 0), 4.0f);  // the second view's own
}

TEST(ImportNpz, BadInputsAreErrorsOfOneLine) {
  const std::vector<float> nans(24, kNan);
  const std::vector<std::pair<std::string, std::string>> cases = {
      {MessageWith("extrinsic", NpyFloats("(3, 3, 4)", std::vector<float>(36, 1))), "3 views"},
      {MessageWith("extrinsic", NpyFloats("(2, 12)", kExtrinsics)), "(S, 3, 4)"},
      {MessageWith("extrinsic", NpyFloats("(2, 3, 4)", std::vector<float>(24, 0.1f))), "rotation"},
      {MessageWith("extrinsic", NpyFloats("(2, 3, 4)", nans)), "no usable view"},
      {MessageWith("intrinsic", NpyFloats("(3, 3)", std::vector<float>(9, 1))), "2 views"},
      {MessageWith("depth", NpyFloats("(2, 14, 27)", std::vector<float>(2 * 14 * 27, 1))), "28"},
      {MessageWith("depth", NpyFloats("(1, 14, 28)", std::vector<float>(392, 1))), "2 views"},
      {MessageWith("depth", NpyFloats("(2, 14, 28, 3)", std::vector<float>(2352, 1))), "(S, H, W)"},
      {MessageWith("depth", NpyFloats("(2, 0, 28)", {})), "(S, H, W)"},
      {MessageWith("depth", NpyFloats("(2, 14, 28)", {1, 2, 3})), "truncated"},
      {MessageWith("depth", NpyBytes("<f4", "(2, 1099511627776, 28)", "")), "truncated"},
      {MessageWith("depth", "no array"), "magic"},
      {MessageWith("depth_conf", NpyBytes("|O", "(2,)", "x")), "'|O'"}};
  for (const auto& [message, expected] : cases) {
    EXPECT_NE(message.find(expected), std::string::npos) << expected << " in: " << message;
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(ImportNpz, TheCountOfPhotosMustBeTheCountOfViews) {
  Case test(TwoViews(), {"a.png", "b.png", "c.png"});
  EXPECT_NE(test.Message().find("holds 2 views, expected one for each of the 3 photos"),
            std::string::npos);
}

TEST(ImportNpz, QuaternionsOfMatricesCannotBeSwapped) {
  Case test(TwoViews());
  EXPECT_NE(test.Message({.repair = {.swap_quaternion_order = true}}).find("matrices"),
            std::string::npos);
}

TEST(ImportNpzFolder, OneArchivePerPhoto) {
  Case test(TwoViews(), {"a.png", "sub/b.png", "c.png"});
  const auto single = [&](float depth) {
    return Arrays{{"extrinsic", NpyFloats("(3, 4)", {1, 0, 0, depth, 0, 1, 0, 0, 0, 0, 1, 0})},
                  {"intrinsic", NpyFloats("(3, 3)", {30, 0, 14, 0, 31, 7, 0, 0, 1})},
                  {"depth", NpyFloats("(14, 28)", std::vector<float>(kNumPixels, depth))}};
  };
  const fs::path input = test.folder / "per_image";
  fs::create_directories(input / "sub");
  WriteNpz(input / "a.npz", single(3));              // by stem
  WriteNpz(input / "sub" / "b.png.npz", single(5));  // by name
  WriteNpz(input / "unrelated.npz", {{"x", NpyFloats("(1,)", {0})}});
  test.input = input;
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kNpzFolder);
  EXPECT_EQ(summary.num_views, 2u);
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_NE(summary.notes[0].find("1 photos have no arrays"), std::string::npos);
  const Prediction prediction = ReadPrediction(test.output);
  EXPECT_EQ(prediction.views[0].view.name, "a.png");
  EXPECT_EQ(prediction.views[0].depth(0, 0), 3.0f);
  EXPECT_EQ(prediction.views[1].view.name, "sub/b.png");
  EXPECT_EQ(prediction.views[1].depth(0, 0), 5.0f);
  EXPECT_EQ(prediction.views[1].view.cam_from_world.translation.x(), 5.0);
}

TEST(ImportNpzFolder, FoldersOfNpyFilesAndDoubledNames) {
  Case test(TwoViews(), {"a.png"});
  const fs::path input = test.folder / "per_image";
  fs::create_directories(input / "a");
  WriteFileAtomically(input / "a" / "extrinsic.npy",
                      NpyFloats("(1, 3, 4)", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 9}));
  test.input = input;
  const Prediction prediction = test.RunAndRead({.camera_params = "50"});
  EXPECT_EQ(prediction.views[0].view.cam_from_world.translation.z(), 9.0);
  WriteNpz(input / "a.npz", TwoViews());
  fs::remove_all(test.output);
  EXPECT_NE(test.Message().find("the same photo"), std::string::npos);
}

// As export_to_npz of Depth Anything 3 writes two views; maps of 28x14.
Arrays DepthAnything3Views() {
  std::vector<float> depth = Constant(2, 4);
  for (size_t i = 0; i < depth.size(); ++i) depth[i] += 0.001f * static_cast<float>(i);
  return {{"image", NpyBytes("|u1", "(2, 14, 28, 3)", std::string(2 * kNumPixels * 3, 'x'))},
          {"depth", NpyFloats("(2, 14, 28)", depth)},
          {"conf", NpyFloats("(2, 14, 28)", Constant(1.25, 7))},
          {"extrinsics", NpyFloats("(2, 3, 4)", kExtrinsics)},
          {"intrinsics", NpyFloats("(2, 3, 3)", kIntrinsics)}};
}

TEST(ImportDepthAnything3, FilesOfItsWriterAreUnderstood) {
  Case test(DepthAnything3Views());
  const fs::path written = test.folder / "scene" / "exports" / "mini_npz" / "results.npz";
  fs::create_directories(written.parent_path());
  Arrays mini = DepthAnything3Views();
  mini.erase("image");
  WriteNpz(written, mini, /*compressed=*/true);
  for (const fs::path& input : {test.input, test.folder / "scene"}) {
    test.input = input;
    const ImportSummary summary = test.Run({.overwrite = true});
    EXPECT_EQ(summary.format, ImportFormat::kDa3Npz);
    EXPECT_EQ(summary.resize, ImportResize::kStretch);
    EXPECT_TRUE(summary.warnings.empty());
    const Prediction prediction = ReadPrediction(test.output);
    EXPECT_EQ(prediction.views[1].view.camera.params, (std::vector<double>{64, 66, 28, 14}));
    const Eigen::Vector3d point =
        prediction.views[1].view.cam_from_world * Eigen::Vector3d(5, 6, 7);
    EXPECT_LT((point - Eigen::Vector3d(7 + 1, 6 - 2, -5 + 3)).norm(), 1e-12);
    EXPECT_EQ(prediction.views[0].depth(5, 1), 2.0f + 0.001f * 33.0f);
    EXPECT_EQ(prediction.views[1].depth_conf(0, 0), 7.0f);
  }
}

TEST(ImportDepthAnything3, PhotosOfSeveralShapesWereCutToTheSmallest) {
  // At 504: 504x252 and 252x504, both cut to 252x252 around the centre; 126 columns are gone.
  constexpr size_t kPixels = 252 * 252;
  Arrays arrays = DepthAnything3Views();
  arrays.erase("image");
  arrays["depth"] = NpyFloats("(2, 252, 252)", std::vector<float>(2 * kPixels, 3.0f));
  arrays["conf"] = NpyFloats("(2, 252, 252)", std::vector<float>(2 * kPixels, 1.0f));
  arrays["intrinsics"] = NpyFloats(
      "(2, 3, 3)", {300, 0, 126, 0, 300, 126, 0, 0, 1, 300, 0, 126, 0, 300, 126, 0, 0, 1});
  Case test(arrays, {"a.png"});
  WritePhotos(test.photos, {"b.png"}, kPhotoHeight, kPhotoWidth);
  const Prediction prediction = test.RunAndRead();
  // A scale of 1/9 on all sides, and principal points in the middle of each photo.
  const std::vector<double> wide = prediction.views[0].view.camera.params;
  const std::vector<double> upright = prediction.views[1].view.camera.params;
  const std::vector<double> wide_truth = {300.0 / 9, 300.0 / 9, 28, 14};
  const std::vector<double> upright_truth = {300.0 / 9, 300.0 / 9, 14, 28};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(wide[i], wide_truth[i], 1e-9);
    EXPECT_NEAR(upright[i], upright_truth[i], 1e-9);
  }
}

TEST(ImportDepthAnything3, DamagedFilesAreNamed) {
  Arrays shape = DepthAnything3Views();
  shape["conf"] = NpyFloats("(2, 28, 14)", Constant(1, 1));
  EXPECT_NE(Case(shape).Message().find("(2, 28, 14)"), std::string::npos);
  Arrays fewer = DepthAnything3Views();
  EXPECT_NE(Case(fewer, {"a.png", "b.png", "c.png"}).Message().find("2 views"), std::string::npos);
  Case other(DepthAnything3Views());
  WritePhotos(other.photos, {"a.png", "b.png"}, 64, 64);
  EXPECT_NE(other.Message().find("upper_bound_resize"), std::string::npos);
  Arrays nan = DepthAnything3Views();
  std::vector<float> extrinsics = kExtrinsics;
  extrinsics[3] = kNan;
  nan["extrinsics"] = NpyFloats("(2, 3, 4)", extrinsics);
  const ImportSummary summary = Case(nan).Run();
  EXPECT_EQ(summary.num_views, 1u);
  EXPECT_EQ(summary.warnings.size(), 1u);
}

}  // namespace
}  // namespace vgtw
