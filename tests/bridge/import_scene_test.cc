// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import.h"
#include "bridge/predictions.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/bridge/import_case.h"
#include "tests/bridge/numpy_files.h"
#include "tests/bridge/sample_scene.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using Arrays = std::map<std::string, std::string>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

struct Case : ImportCase {
  Case(int photo_width, int photo_height, const std::string& file, const Arrays& arrays)
      : ImportCase("run") {
    WritePhotos(photos, {"a.png", "b.png", "c.png"}, photo_width, photo_height);
    fs::create_directories(input);
    WriteNpz(input / file, arrays);
  }
  Prediction Read() const { return ReadPrediction(output); }
};

void ExpectTruePoses(const Prediction& prediction) {
  ASSERT_EQ(prediction.views.size(), kNumSceneViews);
  for (size_t i = 0; i < kNumSceneViews; ++i) {
    const Eigen::Matrix<double, 3, 4> truth = Inverse(WorldFromCam(i)).ToMatrix();
    // The files hold float: 6e-8 relative.
    EXPECT_LT((prediction.views[i].view.cam_from_world.ToMatrix() - truth).norm(), 1e-6) << i;
  }
}

// The depth that was derived from points, at every pixel.
void ExpectTrueDepth(const SampleScene& scene, const Prediction& prediction) {
  for (size_t i = 0; i < kNumSceneViews; ++i) {
    const std::vector<float>& read = prediction.views[i].depth.data();
    ASSERT_EQ(read.size(), scene.NumPixels());
    for (size_t k = 0; k < read.size(); ++k) {
      EXPECT_NEAR(read[k], scene.depth[i * read.size() + k], 3e-6) << i << " " << k;
    }
  }
}

// --- pi3 ------------------------------------------------------------------------------------

// Photos of 112x80 become 56x42: stretched, by 2 and 80/42.
SampleScene Pi3Scene(bool is_inverted = false) { return {56, 42, 50.0, 52.0, is_inverted}; }

// numpy.savez(**predictions) of demo_gradio.py: the confidence keeps its channel.
Arrays Pi3Arrays(const SampleScene& scene) {
  return {{"points", scene.Points()},
          {"conf", NpyFloats(scene.Shape(", 1)"), std::vector<float>(scene.depth.size(), 0.75f))},
          {"camera_poses", scene.Poses()},
          {"images", NpyFloats("(1,)", {0})}};
}

struct Pi3Case : Case {
  explicit Pi3Case(const SampleScene& scene) : Pi3Case(Pi3Arrays(scene)) {}
  explicit Pi3Case(const Arrays& arrays) : Case(112, 80, "predictions.npz", arrays) {}
};

TEST(ImportPi3, PosesDepthAndFittedCamerasAreTheTruth) {
  const SampleScene scene = Pi3Scene();
  Pi3Case test(scene);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kPi3);
  EXPECT_EQ(summary.resize, ImportResize::kStretch);
  EXPECT_TRUE(summary.warnings.empty());
  ASSERT_EQ(summary.notes.size(), 2u);
  ExpectHas(summary.notes[1], "intrinsics of 3 views were fitted");
  const Prediction prediction = test.Read();
  ExpectTruePoses(prediction);
  ExpectTrueDepth(scene, prediction);
  const std::vector<double> truth = {100.0, 52.0 * 80.0 / 42.0, 56.0, 40.0};
  for (const ViewPrediction& view : prediction.views) {
    for (size_t k = 0; k < 4; ++k) EXPECT_NEAR(view.view.camera.params[k], truth[k], 1e-4);
    EXPECT_EQ(view.depth_conf(5, 5), 0.75f);
    EXPECT_EQ(Apply(view.view.original_from_network, {0.5, 0.0}), Eigen::Vector2d(1, 0));
  }
}

TEST(ImportPi3, PosesTheWrongWayRoundAreNamed) {
  Pi3Case test(Pi3Scene(/*is_inverted=*/true));
  ExpectHas(test.Message(), "import with --invert_poses");
  test.Run({.repair = {.invert_poses = true}});
  ExpectTruePoses(test.Read());
  Pi3Case right(Pi3Scene());
  ExpectHas(right.Message({.repair = {.invert_poses = true}}), "without the repairs");
}

TEST(ImportPi3, OpenGlAxesAreNamed) {
  SampleScene scene = Pi3Scene();
  for (size_t i = 0; i < scene.poses.size(); ++i) {
    if (i % 16 < 12 && (i % 4 == 1 || i % 4 == 2)) scene.poses[i] = -scene.poses[i];
  }
  Pi3Case test(scene);
  ExpectHas(test.Message(), "import with --opengl_axes");
  test.Run({.repair = {.opengl_axes = true}});
  ExpectTruePoses(test.Read());
}

TEST(ImportPi3, GivenCameraParametersAreTaken) {
  Pi3Case test(Pi3Scene());
  const ImportSummary summary = test.Run({.camera_params = "90"});
  EXPECT_EQ(summary.notes.size(), 1u);
  EXPECT_EQ(test.Read().views[2].view.camera.params, (std::vector<double>{90, 90, 56, 40}));
}

TEST(ImportPi3, BadViewsAreLeftOut) {
  SampleScene scene = Pi3Scene();
  scene.poses[0] = kNan;
  const auto second = scene.points.begin() + static_cast<ptrdiff_t>(3 * scene.NumPixels());
  for (size_t k = 0; k < 3 * scene.NumPixels(); ++k) {
    second[static_cast<ptrdiff_t>(k)] = std::sin(1e3f * static_cast<float>(k));
  }
  Pi3Case test(scene);
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.num_views, 1u);
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "2 views are left out");
  EXPECT_EQ(test.Read().views[0].view.name, "c.png");
}

TEST(ImportPi3, OtherPhotosAreNamed) {
  Pi3Case others(Pi3Scene());
  WritePhotos(others.photos, {"a.png", "b.png", "c.png"}, 40, 224);
  ExpectHas(others.Message(), "56x42 for a.png of 40x224");
  Pi3Case more(Pi3Scene());
  WritePhotos(more.photos, {"d.png"}, 112, 80);
  ExpectHas(more.Message(), "holds 3 views, expected one for each of the 4 photos");
}

TEST(ImportPi3, WrongShapesAreNamed) {
  const SampleScene scene = Pi3Scene();
  Arrays flat = Pi3Arrays(scene);
  flat["points"] = NpyFloats("(3, 2352, 3)", scene.points);
  ExpectHas(Pi3Case(flat).Message(), "points: has shape (3, 2352, 3), expected maps of 42 rows");
  Arrays fewer = Pi3Arrays(scene);
  fewer["camera_poses"] = NpyFloats("(2, 4, 4)", {scene.poses.begin(), scene.poses.begin() + 32});
  ExpectHas(Pi3Case(fewer).Message(), "2 views like the other arrays");
  Arrays scaled = Pi3Arrays(scene);
  std::vector<float> poses = scene.poses;
  for (float& value : poses) value *= 2.0f;
  scaled["camera_poses"] = NpyFloats("(3, 4, 4)", poses);
  ExpectHas(Pi3Case(scaled).Message(), "no rotation");
}

// --- Fast3R ---------------------------------------------------------------------------------

// Photos of 64x48 through DUSt3R's loader at 32: resized to 32x24, rows 4 to 19 kept.
SampleScene Dust3rScene(bool is_inverted = false) { return {32, 16, 30.5, 30.5, is_inverted}; }

Arrays Fast3rArrays(const SampleScene& scene) {
  std::vector<float> local = scene.points;
  for (float& value : local) value = 3.0f * value + 1.0f;
  return {{"global_pointmaps", NpyFloats(scene.Shape(", 3)"), local)},
          {"global_confidence_maps", scene.Map(1.0f)},
          {"local_pointmaps", NpyFloats(scene.Shape(", 3)"), local)},
          {"local_aligned_to_global_pointmaps", scene.Points()},
          {"local_confidence_maps", scene.Map(2.5f)},
          {"estimated_focals", NpyDoubles("(3,)", {30.5, 30.5, 30.5})},
          {"estimated_poses_c2w", scene.Poses()}};
}

struct Fast3rCase : Case {
  explicit Fast3rCase(const Arrays& arrays)
      : Case(64, 48, "pointmaps_and_camera_params.npz", arrays) {}
};

TEST(ImportFast3r, AlignedPointsGiveDepthInTheScaleOfThePoses) {
  const SampleScene scene = Dust3rScene();
  Fast3rCase test(Fast3rArrays(scene));
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kFast3r);
  EXPECT_EQ(summary.resize, ImportResize::kCrop);
  EXPECT_TRUE(summary.warnings.empty());
  const Prediction prediction = test.Read();
  ExpectTruePoses(prediction);
  ExpectTrueDepth(scene, prediction);
  // The scale is 2; four rows were cut, so that cy = (8 + 4) * 2.
  EXPECT_EQ(prediction.views[1].view.camera.params, (std::vector<double>{61, 61, 32, 24}));
  EXPECT_EQ(prediction.views[1].depth_conf(0, 0), 2.5f);
}

TEST(ImportFast3r, ListsOfDifferentShapesAreNamed) {
  Arrays ragged = Fast3rArrays(Dust3rScene());
  ragged["local_aligned_to_global_pointmaps"] = NpyBytes("|O", "(3,)", "pickle");
  ExpectHas(Fast3rCase(ragged).Message(), "local_aligned_to_global_pointmaps");
}

// --- DUSt3R and MASt3R ----------------------------------------------------------------------

// numpy.savez(poses=scene.get_im_poses(), focals=scene.get_focals(), ...), stacked.
Arrays Dust3rArrays(const SampleScene& scene) {
  return {{"poses", scene.Poses()},
          {"focals", NpyFloats("(3, 1)", {30.5f, 31.0f, 31.5f})},
          {"depthmaps", NpyFloats(scene.Shape(")"), scene.depth)},
          {"confs", scene.Map(4.0f)},
          {"pts3d", scene.Points()}};
}

struct Dust3rCase : Case {
  explicit Dust3rCase(const Arrays& arrays) : Case(64, 48, "scene.npz", arrays) {
    input /= "scene.npz";
  }
};

TEST(ImportDust3r, SceneIsReadFromAnArchiveAndFromAFolder) {
  const SampleScene scene = Dust3rScene();
  for (const bool is_folder : {false, true}) {
    Dust3rCase test(Dust3rArrays(scene));
    if (is_folder) {
      test.input = test.folder / "arrays";
      fs::create_directories(test.input);
      for (const auto& [key, bytes] : Dust3rArrays(scene)) {
        WriteFileAtomically(test.input / (key + ".npy"), bytes);
      }
    }
    const ImportSummary summary = test.Run();
    EXPECT_EQ(summary.format, ImportFormat::kDust3r);
    EXPECT_TRUE(summary.warnings.empty());
    const Prediction prediction = test.Read();
    ExpectTruePoses(prediction);
    EXPECT_EQ(prediction.views[2].depth(3, 7), scene.depth[2 * 512 + 7 * 32 + 3]);
    EXPECT_EQ(prediction.views[2].view.camera.params, (std::vector<double>{63, 63, 32, 24}));
    EXPECT_EQ(prediction.views[0].depth_conf(0, 0), 4.0f);
  }
}

TEST(ImportDust3r, PrincipalPointsAndMatricesAreTaken) {
  Arrays centres = Dust3rArrays(Dust3rScene());
  centres["pps"] = NpyFloats("(3, 2)", {16, 8, 17, 8.5, 16, 8});
  Dust3rCase test(centres);
  test.Run();
  EXPECT_EQ(test.Read().views[1].view.camera.params, (std::vector<double>{62, 62, 34, 25}));
  Arrays matrices = Dust3rArrays(Dust3rScene());
  std::vector<float> k;
  for (size_t i = 0; i < kNumSceneViews; ++i) k.insert(k.end(), {20, 0, 16, 0, 22, 8, 0, 0, 1});
  matrices["intrinsics"] = NpyFloats("(3, 3, 3)", k);
  Dust3rCase other(matrices);
  other.Run();
  EXPECT_EQ(other.Read().views[1].view.camera.params, (std::vector<double>{40, 44, 32, 24}));
}

TEST(ImportDust3r, PosesTheWrongWayRoundAreNoticed) {
  Dust3rCase test(Dust3rArrays(Dust3rScene(/*is_inverted=*/true)));
  const ImportSummary summary = test.Run();
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "--invert_poses");
}

// 64x48 becomes 512x384 there: a focal length of 400 is 50 in the photo.
TEST(ImportDust3r, FocalLengthsWithoutMapsNeedASize) {
  const Arrays arrays = {{"cams2world", Dust3rScene().Poses()},
                         {"focals", NpyFloats("(3,)", {400, 400, 400})}};
  Dust3rCase test(arrays);
  const ImportSummary summary = test.Run();
  ASSERT_EQ(summary.warnings.size(), 1u);
  ExpectHas(summary.warnings[0], "512x384");
  EXPECT_EQ(test.Read().views[1].view.camera.params, (std::vector<double>{50, 50, 32, 24}));
  Dust3rCase given(arrays);
  EXPECT_TRUE(given.Run({.camera_params = "77"}).warnings.empty());
  EXPECT_EQ(given.Read().views[1].view.camera.params, (std::vector<double>{77, 77, 32, 24}));
}

TEST(ImportDust3r, WrongShapesAreNamed) {
  Arrays focals = Dust3rArrays(Dust3rScene());
  focals["focals"] = NpyFloats("(3, 3)", std::vector<float>(9, 30.0f));
  ExpectHas(Dust3rCase(focals).Message(), "(S,), (S, 1) or (S, 2)");
  focals["focals"] = NpyFloats("(2,)", {30, 30});
  ExpectHas(Dust3rCase(focals).Message(), "3 views like the other arrays");
  Arrays size = Dust3rArrays(Dust3rScene());
  size["confs"] = NpyFloats("(3, 16, 16)", std::vector<float>(768, 1.0f));
  ExpectHas(Dust3rCase(size).Message(), "like the other arrays");
  Arrays zero = Dust3rArrays(Dust3rScene());
  zero["focals"] = NpyFloats("(3,)", {30, 0, kNan});
  Dust3rCase bad(zero);
  EXPECT_EQ(bad.Run().num_views, 1u);
  Dust3rCase photos(Dust3rArrays(Dust3rScene()));
  WritePhotos(photos.photos, {"a.png", "b.png", "c.png"}, 48, 64);
  ExpectHas(photos.Message(), "32x16 for a.png of 48x64");
}

// --- MapAnything ----------------------------------------------------------------------------

// Photos of 64x48 cover 56x28 as 56x42; rows 7 to 34 are kept.
SampleScene MapAnythingScene() { return {56, 28, 49.0, 49.0}; }

// predictions.npz of scripts/gradio_app.py: VGGT's words, but extrinsic is world_from_cam.
Arrays MapAnythingArrays(const SampleScene& scene) {
  std::vector<float> k;
  for (size_t i = 0; i < kNumSceneViews; ++i) k.insert(k.end(), {49, 0, 28, 0, 49, 14, 0, 0, 1});
  std::string is_valid(scene.depth.size(), '\1');
  is_valid[5] = '\0';
  return {{"extrinsic", scene.Poses()},
          {"intrinsic", NpyFloats("(3, 3, 3)", k)},
          {"world_points", scene.Points()},
          {"depth", NpyFloats(scene.Shape(", 1)"), scene.depth)},
          {"conf", scene.Map(3.0f)},
          {"final_mask", NpyBytes("|b1", scene.Shape(")"), is_valid)}};
}

TEST(ImportMapAnything, PosesAreWorldFromCamAndCropsAreUndone) {
  const SampleScene scene = MapAnythingScene();
  Case test(64, 48, "predictions.npz", MapAnythingArrays(scene));
  const ImportSummary summary = test.Run();
  EXPECT_EQ(summary.format, ImportFormat::kMapAnything);
  EXPECT_EQ(summary.resize, ImportResize::kCrop);
  EXPECT_TRUE(summary.warnings.empty());
  const Prediction prediction = test.Read();
  ExpectTruePoses(prediction);
  const View& view = prediction.views[0].view;
  EXPECT_TRUE(Apply(view.original_from_network, {0, 0}).isApprox(Eigen::Vector2d(0, 8)));
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(view.camera.params[k], (std::vector<double>{56, 56, 32, 24})[k], 1e-9);
  }
  EXPECT_TRUE(std::isnan(prediction.views[0].depth(5, 0)));
  EXPECT_TRUE(std::isnan(prediction.views[0].points(5, 0).x()));
  EXPECT_EQ(prediction.views[0].depth(6, 0), scene.depth[6]);
  EXPECT_EQ(prediction.views[1].depth(5, 0), scene.depth[scene.NumPixels() + 5]);
}

TEST(ImportMapAnything, OtherPhotosAreNamed) {
  Case test(48, 200, "predictions.npz", MapAnythingArrays(MapAnythingScene()));
  ExpectHas(test.Message(), "56x28 for a.png of 48x200");
}

}  // namespace
}  // namespace vgtw
