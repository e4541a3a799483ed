// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/export_points.h"

#include "scene/error.h"
#include "scene/image_io.h"
#include "scene/synthetic.h"
#include "tests/bridge/sample_model.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <set>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class ExportPointsTest : public testing::Test {
 protected:
  SurfaceCloud Export(const Prediction& prediction, const ExportPointsOptions& options) const {
    WritePrediction(prediction, folder_ / "predictions", true);
    return PointsOfPredictions(PredictionReader(folder_ / "predictions"), options);
  }

  static ExportPointsOptions AllPixels() {
    ExportPointsOptions options;
    options.filter.keep_percent = 100.0;
    options.num_threads = 2;
    return options;
  }

  const TemporaryFolder folder_;
};

// Network pixel (x, y) is the centre of the 2 x 2 pixels of the photo from (2 x, 2 y).
TEST_F(ExportPointsTest, PixelsGiveTheirPointsColoursNormalsAndConfidences) {
  Prediction prediction;
  prediction.views = {MakeWallView("a.png", -0.5), MakeWallView("b.png", 0.5)};
  prediction.views[1].view.cam_from_world.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  for (ViewPrediction& view : prediction.views) {
    view.depth_conf = ConfidenceMap(32, 24, 1.0f);
    view.depth_conf(3, 2) = 4.0f;
    RgbImage photo(64, 48, Rgb{10, 20, 30});
    photo(7, 5) = {200, 100, 50};
    WriteImage(folder_ / "photos" / view.view.name, photo);
  }
  ExportPointsOptions options = AllPixels();
  options.image_folder = folder_ / "photos";
  const SurfaceCloud cloud = Export(prediction, options);
  ASSERT_EQ(cloud.points.size(), 2u * 32 * 24);
  ASSERT_EQ(cloud.scalars.size(), 1u);
  EXPECT_EQ(cloud.scalars[0].name, "confidence");
  for (size_t i = 0; i < 2; ++i) {
    const size_t idx = i * 32 * 24 + 2 * 32 + 3;
    const Rigid3d world_from_cam = Inverse(prediction.views[i].view.cam_from_world);
    const Eigen::Vector3d in_cam(
        (7.0 - 32.0) / 61.2 * kWallDepth, (5.0 - 24.0) / 61.2 * kWallDepth, kWallDepth);
    EXPECT_LT((cloud.points[idx].xyz - (world_from_cam * in_cam).cast<float>()).norm(), 1e-6f);
    EXPECT_EQ(cloud.points[idx].rgb, (Rgb{200, 100, 50}));
    const Eigen::Vector3d normal = world_from_cam.rotation * -Eigen::Vector3d::UnitZ();
    EXPECT_LT((cloud.normals[idx] - normal.cast<float>()).norm(), 1e-5f);
    EXPECT_EQ(cloud.scalars[0].values[idx], 4.0f);
    EXPECT_EQ(cloud.points[idx + 1].rgb, (Rgb{10, 20, 30}));
    EXPECT_EQ(cloud.scalars[0].values[idx + 1], 1.0f);
  }
}

TEST_F(ExportPointsTest, ConfidentStaticPixelsAreKept) {
  Prediction prediction;
  prediction.views = {MakeWallView("a.png", 0.0)};
  ViewPrediction& view = prediction.views[0];
  view.depth_conf = ConfidenceMap(32, 24, 1.0f);
  view.distractor = DistractorMask(32, 24, 0.0f);
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 16; ++x) view.depth_conf(x, y) = 2.0f;
    view.distractor(0, y) = 0.6f;
  }
  ExportPointsOptions options;
  EXPECT_EQ(Export(prediction, options).points.size(), 15u * 24);
  options.filter.distractor_threshold = 0.7;
  EXPECT_EQ(Export(prediction, options).points.size(), 16u * 24);
  options.filter.distractor_threshold = 0.5;
  view.distractor = DistractorMask(32, 24, 1.0f);
  EXPECT_THAT(ErrorOf([&] { Export(prediction, options); }), HasSubstr("--mask_threshold"));
}

TEST_F(ExportPointsTest, WhatNoViewHasIsLeftOut) {
  Prediction prediction;
  prediction.views = {MakeWallView("a.png", 0.0)};
  EXPECT_TRUE(Export(prediction, AllPixels()).scalars.empty());
  EXPECT_EQ(Export(prediction, AllPixels()).points[0].rgb, (Rgb{128, 128, 128}));
  prediction.views[0].depth = {};
  prediction.views[0].depth_samples = {{{10.0f, 12.0f}, 5.1f, 3.0f}};
  const SurfaceCloud samples = Export(prediction, AllPixels());
  ASSERT_EQ(samples.points.size(), 1u);
  EXPECT_TRUE(samples.normals.empty());
  EXPECT_EQ(samples.scalars.at(0).values, std::vector<float>{3.0f});
}

// The room is made of planes and balls; the network's grid samples them every 0.4 deg.
TEST_F(ExportPointsTest, NormalsOfARoomFaceItsCamerasAndThreadsChangeNothing) {
  SyntheticOptions room;
  room.num_views = 3;
  const SyntheticScene scene(room);
  const Prediction prediction = MakeTruePrediction(scene, 154);
  ExportPointsOptions options = AllPixels();
  options.num_threads = 1;
  const SurfaceCloud cloud = Export(prediction, options);
  size_t num_upright = 0;
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    // The floor is z = 0, seen from above.
    if (std::abs(cloud.points[i].xyz.z()) > 1e-5f || cloud.normals[i].isZero()) continue;
    EXPECT_GT(cloud.normals[i].z(), 0.0f);
    if (cloud.normals[i].z() > 0.9999f) ++num_upright;
  }
  EXPECT_GT(num_upright, 1000u);
  options.num_threads = 3;
  const SurfaceCloud again = Export(prediction, options);
  EXPECT_EQ(again.normals, cloud.normals);
  EXPECT_EQ(again.scalars[0].values, cloud.scalars[0].values);
}

// Cameras at -0.5 and 0.5: the extent is 1.
TEST_F(ExportPointsTest, ThinningGivesOnePointPerCube) {
  Prediction prediction;
  prediction.views = {MakeWallView("a.png", -0.5), MakeWallView("b.png", 0.5)};
  ExportPointsOptions options = AllPixels();
  options.voxel_size = 0.5;
  const SurfaceCloud thin = Export(prediction, options);
  std::set<std::pair<int, int>> cubes;
  options.voxel_size = 0.0;
  for (const ColoredPoint& point : Export(prediction, options).points) {
    cubes.insert({static_cast<int>(std::floor(point.xyz.x() / 0.5)),
                  static_cast<int>(std::floor(point.xyz.y() / 0.5))});
  }
  EXPECT_EQ(thin.points.size(), cubes.size());
  EXPECT_LT(thin.points.size(), 200u);
  for (const Eigen::Vector3f& normal : thin.normals) {
    EXPECT_LT((normal + Eigen::Vector3f::UnitZ()).norm(), 1e-5f);
  }
}

TEST_F(ExportPointsTest, PhotosMustBeThosePredictedFrom) {
  WriteImage(folder_ / "photos/a.png", RgbImage(32, 24));
  Prediction prediction;
  prediction.views = {MakeWallView("a.png", 0.0)};
  ExportPointsOptions options = AllPixels();
  options.image_folder = folder_ / "photos";
  EXPECT_THAT(ErrorOf([&] { Export(prediction, options); }),
              HasSubstr("32 x 24 pixels, expected 64 x 48"));
}

TEST(ExportPoints, OfAModelHaveItsErrorsAndTrackLengths) {
  Reconstruction model = SampleModel();
  const SurfaceCloud cloud = PointsOfModel(model, 0.0);
  ASSERT_EQ(cloud.points.size(), model.points3D.size());
  ASSERT_EQ(cloud.scalars.size(), 2u);
  size_t i = 0;
  for (const auto& [id, point] : model.points3D) {
    EXPECT_EQ(cloud.points[i].rgb, point.rgb);
    EXPECT_EQ(cloud.scalars[0].values[i], static_cast<float>(point.error));
    EXPECT_EQ(cloud.scalars[1].values[i], static_cast<float>(point.track.size()));
    ++i;
  }
  // In one cube of the camera extent.
  model.points3D.at(5).xyz = {0.3, 0.4, 0.5};
  const SurfaceCloud thin = PointsOfModel(model, 1.0);
  ASSERT_EQ(thin.points.size(), 1u);
  EXPECT_LT((thin.points[0].xyz - Eigen::Vector3f(0.2f, 0.3f, 0.4f)).norm(), 1e-6f);
  EXPECT_EQ(thin.points[0].rgb, (Rgb{128, 1, 66}));
  EXPECT_EQ(thin.scalars[1].values, std::vector<float>{2.0f});
}

}  // namespace
}  // namespace vgtw
