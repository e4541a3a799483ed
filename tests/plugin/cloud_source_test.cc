// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/cloud_source.h"

#include "bridge/colmap_model.h"
#include "bridge/point_cloud.h"
#include "tests/support/bytes.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

const Sim3d kOtherFromWorld = {2.0, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.0, -2.0, 3.0}};

// The wall seen from places that are not on a line, and with a dent, so that either alone
// determines a similarity.
Prediction DentedWall(const Sim3d& moved_from_world) {
  Prediction prediction = MakeWallPrediction();
  prediction.views[0].view.cam_from_world.translation.y() = 0.25;
  for (ViewPrediction& view : prediction.views) {
    view.depth(3, 4) = 4.5f;
    view.depth(20, 9) = 4.0f;
    for (float& depth : view.depth.data()) depth *= static_cast<float>(moved_from_world.scale);
    view.view.cam_from_world = TransformCamera(moved_from_world, view.view.cam_from_world);
  }
  return prediction;
}

class CloudSourceTest : public testing::Test {
 protected:
  CloudSource Predictions(const std::string& name, const Prediction& prediction) const {
    WritePrediction(prediction, folder_ / name, /*overwrite=*/true);
    return Open(name);
  }
  CloudSource Open(const std::string& name) const { return {folder_ / name, filter_}; }

  const TemporaryFolder folder_;
  PredictionFilterOptions filter_{.keep_percent = 100.0};
};

TEST_F(CloudSourceTest, PointsComeFromPredictionsModelsAndPly) {
  CloudSource prediction = Predictions("predictions", MakeWallPrediction());
  EXPECT_EQ(prediction.Points().size(), 3u * 32u * 24u);
  EXPECT_EQ(prediction.poses().size(), 3u);
  EXPECT_THAT(prediction.FilterText(), HasSubstr("distractor probability below 0.50"));

  const Reconstruction model = MakeSyntheticModel({});
  WriteModel(model, folder_ / "model");
  CloudSource from_model = Open("model");
  ASSERT_EQ(from_model.Points().size(), model.points3D.size());
  EXPECT_EQ(from_model.Points()[0], model.points3D.begin()->second.xyz);
  EXPECT_EQ(from_model.poses().size(), model.images.size());
  EXPECT_TRUE(from_model.FilterAsJson().is_null());

  WritePly(folder_ / "points.ply", {{{1.0f, 2.0f, 3.0f}, {0, 0, 0}}});
  CloudSource from_ply = Open("points.ply");
  EXPECT_EQ(from_ply.Points(), (std::vector<Eigen::Vector3d>{{1.0, 2.0, 3.0}}));
  EXPECT_TRUE(from_ply.poses().empty());
}

TEST_F(CloudSourceTest, PixelsAndCamerasGiveTheSimilarityBetweenTheWorlds) {
  const CloudSource prediction = Predictions("prediction", DentedWall({}));
  const CloudSource reference = Predictions("reference", DentedWall(kOtherFromWorld));
  for (const std::string method : {"pixels", "cameras", "auto"}) {
    SCOPED_TRACE(method);
    const CloudAlignment alignment = AlignClouds(prediction, reference, method);
    const Sim3d& motion = alignment.reference_from_prediction;
    // Depths are floats.
    EXPECT_NEAR(motion.scale, 2.0, 1e-6);
    EXPECT_LT((motion.translation - kOtherFromWorld.translation).norm(), 1e-5);
    EXPECT_LT(AngleBetweenDeg(motion.rotation, kOtherFromWorld.rotation), 1e-4);
    EXPECT_EQ(alignment.method, method == "cameras" ? "cameras" : "pixels");
    EXPECT_EQ(alignment.num_pairs, method == "cameras" ? 3u : 3u * 32u * 24u);
    EXPECT_EQ(alignment.num_views, 3u);
  }
  const CloudAlignment none = AlignClouds(prediction, reference, "none");
  EXPECT_EQ(AlignmentText(none), "not aligned");
  EXPECT_EQ(none.reference_from_prediction.scale, 1.0);
}

TEST_F(CloudSourceTest, PredictionsWithoutMapsAreAlignedByCameras) {
  Prediction samples = DentedWall({});
  for (ViewPrediction& view : samples.views) {
    view.depth = {};
    view.view.network_width = view.view.network_height = 0;
    view.depth_samples = {{{20.0f, 20.0f}, 5.0f, 1.0f}};
  }
  CloudSource prediction = Predictions("samples", samples);
  const CloudSource reference = Predictions("reference", DentedWall(kOtherFromWorld));
  EXPECT_EQ(prediction.Points().size(), 3u);
  EXPECT_EQ(AlignClouds(prediction, reference, "auto").method, "cameras");
}

TEST_F(CloudSourceTest, WhatASourceHasNotIsNamed) {
  const CloudSource prediction = Predictions("prediction", DentedWall({}));
  WritePly(folder_ / "points.ply", {{{1.0f, 2.0f, 3.0f}, {0, 0, 0}}});
  const CloudSource ply = Open("points.ply");
  EXPECT_EQ(AlignClouds(prediction, ply, "auto").method, "none");
  EXPECT_THAT(ErrorOf([&] { AlignClouds(prediction, ply, "pixels"); }), HasSubstr("depth maps"));
  EXPECT_THAT(ErrorOf([&] { AlignClouds(prediction, ply, "cameras"); }), HasSubstr("cameras"));
  EXPECT_THAT(ErrorOf([&] { Open("absent"); }), HasSubstr("a COLMAP model or a .ply file"));
  WritePly(folder_ / "empty.ply", {});
  CloudSource empty = Open("empty.ply");
  EXPECT_THAT(ErrorOf([&] { empty.Points(); }), HasSubstr("gives no point"));
  // Three cameras on a line determine no similarity.
  const CloudSource line = Predictions("line", MakeWallPrediction());
  EXPECT_THAT(ErrorOf([&] { AlignClouds(line, line, "cameras"); }), HasSubstr("on a line"));
}

TEST_F(CloudSourceTest, CommonViewsAreOfTheSamePhotos) {
  const CloudSource prediction = Predictions("prediction", DentedWall({}));
  Prediction other = DentedWall({});
  other.views[0].view.name = "z.png";
  std::swap(other.views[0], other.views[2]);
  std::swap(other.views[0], other.views[1]);
  EXPECT_EQ(CommonViews(prediction, Predictions("other", other)),
            (std::vector<std::string>{"b.png", "c.png"}));
  for (ViewPrediction& view : other.views) view.view.camera.width = 65;
  EXPECT_THAT(ErrorOf([&] { CommonViews(prediction, Predictions("wide", other)); }),
              HasSubstr("65 x 48"));
  other.views = {MakeWallView("elsewhere.png", 0.0)};
  EXPECT_THAT(ErrorOf([&] { CommonViews(prediction, Predictions("none", other)); }),
              HasSubstr("no view in common"));
}

TEST(CloudSourceFlags, ChoicesConcernBothFilters) {
  CloudSourceFlags flags;
  flags.keep_scope = "view";
  flags.keep_order = "after";
  flags.Resolve(3);
  for (const PredictionFilterOptions& options : {flags.filter, flags.reference_filter}) {
    EXPECT_FALSE(options.pool_views);
    EXPECT_FALSE(options.percent_of_all);
    EXPECT_EQ(options.num_threads, 3);
  }
  flags.filter.keep_percent = 0.0;
  EXPECT_THROW(flags.Resolve(0), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
