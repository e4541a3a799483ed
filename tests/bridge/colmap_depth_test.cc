// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_depth.h"

#include "bridge/colmap_model.h"
#include "bridge/seed.h"
#include "scene/files.h"
#include "scene/synthetic.h"
#include "tests/bridge/colmap_map.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(ColmapDepth, MapsAreTheBytesOfTheFormat) {
  const TemporaryFolder folder;
  DepthMap depth(2, 2, 1.5f);
  depth(1, 0) = kNan;
  depth(0, 1) = 4.0f;
  WriteColmapDepthMap(folder / "d.bin", depth);
  EXPECT_EQ(ReadFile(folder / "d.bin"), "2&2&1&" + Bytes(1.5f, 0.0f, 4.0f, 1.5f));
  Grid<Eigen::Vector3f> normals(2, 1);
  normals(0, 0) = {0.0f, 0.6f, -0.8f};
  WriteColmapNormalMap(folder / "n.bin", normals);
  EXPECT_EQ(ReadFile(folder / "n.bin"), "2&1&3&" + Bytes(0.0f, 0.0f, 0.6f, 0.0f, -0.8f, 0.0f));
}

// Views "a.png" and "b.png" of the wall and their model, whose points lie `scale` times as far.
class ColmapDepthTest : public testing::Test {
 protected:
  ColmapDepthTest() {
    predictions_.views = {MakeWallView("a.png", 0.0), MakeWallView("b.png", 0.5)};
    model_.cameras[1] = predictions_.views[0].view.camera;
    model_.cameras[1].camera_id = 1;
    for (const ImageId id : {1u, 2u}) {
      Image& image = model_.images[id];
      image.image_id = id;
      image.camera_id = 1;
      image.name = id == 1 ? "a.png" : "b.png";
    }
  }

  // Observations of image 1 (and 2, so that tracks have two).
  void AddPoints(int num_points, double scale) {
    for (int i = 0; i < num_points; ++i) {
      const auto id = static_cast<Point3DId>(i + 1);
      Point3D& point = model_.points3D[id];
      point.xyz = {0.1 * i, 0.0, scale * kWallDepth};
      for (Image* image : {&model_.images.at(1), &model_.images.at(2)}) {
        point.track.push_back({image->image_id, static_cast<uint32_t>(image->points2D.size())});
        image->points2D.push_back({{1.0, 1.0}, id});
      }
    }
  }

  std::vector<DepthMapSummary> Write(ColmapDepthOptions options = {}) {
    options.filter.keep_percent = 100.0;
    WritePrediction(predictions_, folder_ / "predictions", true);
    WriteModel(model_, folder_ / "model", {.overwrite = true});
    return WriteColmapDepthMaps(
        PredictionReader(folder_ / "predictions"), folder_ / "model", folder_ / "dense", options);
  }

  ColmapMap Map(const std::string& kind, const std::string& name) const {
    return ReadColmapMap(folder_ / ("dense/stereo/" + kind + "/" + name + ".geometric.bin"));
  }

  Prediction predictions_;
  Reconstruction model_;
  const TemporaryFolder folder_;
};

TEST_F(ColmapDepthTest, MapsHaveThePhotosSizeAndLackDistractors) {
  predictions_.views[0].distractor = DistractorMask(32, 24, 0.0f);
  predictions_.views[0].distractor(5, 4) = 1.0f;
  const auto summaries = Write();
  const ColmapMap depth = Map("depth_maps", "a.png");
  ASSERT_EQ(depth.width, 64);
  ASSERT_EQ(depth.height, 48);
  ASSERT_EQ(depth.num_channels, 1);
  const ColmapMap normals = Map("normal_maps", "a.png");
  ASSERT_EQ(normals.num_channels, 3);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool is_distractor = x / 2 == 5 && y / 2 == 4;
      ASSERT_EQ(depth.At(x, y, 0), is_distractor ? 0.0f : static_cast<float>(kWallDepth));
      ASSERT_NEAR(normals.At(x, y, 2), is_distractor ? 0.0f : -1.0f, 1e-6f);
    }
  }
  ASSERT_EQ(summaries.size(), 2u);
  EXPECT_EQ(summaries[0].known_share, 1.0 - 4.0 / (64 * 48));
  EXPECT_EQ(summaries[1].known_share, 1.0);
  EXPECT_EQ(ReadFile(folder_ / "dense/stereo/fusion.cfg"), "a.png\nb.png\n");
}

TEST_F(ColmapDepthTest, DepthsTakeTheScaleOfTheModelsPoints) {
  AddPoints(20, 2.0);
  auto summaries = Write();
  EXPECT_EQ(summaries[0].num_scale_points, 20u);
  EXPECT_NEAR(summaries[0].scale, 2.0, 1e-6);
  EXPECT_NEAR(Map("depth_maps", "a.png").At(30, 20, 0), 2.0 * kWallDepth, 1e-5);
  summaries = Write({.rescale = false, .overwrite = true});
  EXPECT_EQ(summaries[0].scale, 1.0);
  EXPECT_EQ(Map("depth_maps", "a.png").At(30, 20, 0), static_cast<float>(kWallDepth));
}

// Image 2 looks the other way, so that it sees none of the points.
TEST_F(ColmapDepthTest, PhotosWithFewPointsTakeTheScaleOfTheOthers) {
  AddPoints(20, 3.0);
  model_.images.at(2).cam_from_world.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(3.14, Eigen::Vector3d::UnitY()));
  auto summaries = Write();
  EXPECT_EQ(summaries[1].num_scale_points, 0u);
  EXPECT_NEAR(summaries[1].scale, 3.0, 1e-6);
  model_.points3D.clear();
  for (auto& [id, image] : model_.images) image.points2D.clear();
  AddPoints(static_cast<int>(kMinScalePoints) - 1, 3.0);
  summaries = Write({.overwrite = true});
  EXPECT_EQ(summaries[0].scale, 1.0);
}

TEST_F(ColmapDepthTest, MapsThatAreThereAreKept) {
  Write();
  EXPECT_THAT(ErrorOf([&] { Write(); }), HasSubstr("--overwrite"));
  // What image_undistorter leaves: empty folders, and files of its own beside them.
  std::filesystem::remove_all(folder_ / "dense/stereo");
  std::filesystem::create_directories(folder_ / "dense/stereo/depth_maps/sub");
  std::filesystem::create_directories(folder_ / "dense/stereo/normal_maps/sub");
  WriteFileAtomically(folder_ / "dense/stereo/fusion.cfg", "mine");
  Write({.with_normals = false});
  EXPECT_EQ(Map("depth_maps", "a.png").width, 64);
  EXPECT_TRUE(std::filesystem::is_empty(folder_ / "dense/stereo/normal_maps/sub"));
  EXPECT_EQ(ReadFile(folder_ / "dense/stereo/fusion.cfg"), "mine");
}

TEST_F(ColmapDepthTest, PhotosWithoutAMapAreLeftOut) {
  predictions_.views[1].depth = {};
  predictions_.views[1].view.name = "other.png";
  const auto summaries = Write();
  EXPECT_TRUE(summaries[0].has_map);
  EXPECT_FALSE(summaries[1].has_map);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "dense/stereo/depth_maps/b.png.geometric.bin"));
  EXPECT_EQ(ReadFile(folder_ / "dense/stereo/fusion.cfg"), "a.png\n");
  predictions_.views[0].depth = {};
  EXPECT_THAT(ErrorOf([&] { Write({.overwrite = true}); }), HasSubstr("has no depth map"));
}

TEST_F(ColmapDepthTest, LensesThatAreNoPinholeNeedAWorkspace) {
  model_.cameras[1].model = CameraModel::kSimpleRadial;
  model_.cameras[1].params = {61.2, 32.0, 24.0, 0.01};
  EXPECT_THAT(ErrorOf([&] { Write(); }), HasSubstr("image_undistorter"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "dense/stereo/depth_maps"));
}

// An undistorted image of another size and focal length: its rays meet the scene where the photo's
// do. Depth between the pixels of the network is exact on what faces the camera and off by the
// curvature of 1 / depth elsewhere, across creases by more.
TEST_F(ColmapDepthTest, UndistortedPixelsHaveTheDepthOfTheirRays) {
  SyntheticOptions room;
  room.num_views = 2;
  room.width = 320;
  room.height = 240;
  room.num_distractors = 0;
  room.radial_distortion = -0.1;
  const SyntheticScene scene(room);
  predictions_ = MakeTruePrediction(scene, 252);
  WritePrediction(predictions_, folder_ / "predictions", true);
  SeedOptions seed;
  seed.with_points = false;
  model_ = MakeSeed(PredictionReader(folder_ / "predictions"), seed).reconstruction;
  const Camera pinhole = MakePinhole(250, 200, 240.0, 245.0);
  Reconstruction undistorted = model_;
  for (auto& [id, camera] : undistorted.cameras) {
    camera = pinhole;
    camera.camera_id = id;
  }
  WriteModel(undistorted, folder_ / "dense/sparse");
  Write();
  size_t num_known = 0;
  size_t num_off = 0;
  for (size_t i = 0; i < 2; ++i) {
    const View& view = scene.views()[i];
    const ColmapMap depth = Map("depth_maps", view.name);
    ASSERT_EQ(depth.width, 250);
    for (int y = 0; y < 200; y += 2) {
      for (int x = 0; x < 250; x += 2) {
        if (depth.At(x, y, 0) == 0.0f) continue;
        const auto ray = Unproject(pinhole, {x + 0.5, y + 0.5});
        const auto truth = scene.StaticPoint(i, *Project(view.camera, ray->homogeneous()));
        ASSERT_TRUE(truth);
        const double z = (view.cam_from_world * *truth).z();
        ++num_known;
        if (std::abs(depth.At(x, y, 0) - z) > 1e-3 * z) ++num_off;
      }
    }
  }
  EXPECT_GT(num_known, 2u * 125 * 100 * 9 / 10);
  EXPECT_LT(num_off, num_known / 50);
}

}  // namespace
}  // namespace vgtw
