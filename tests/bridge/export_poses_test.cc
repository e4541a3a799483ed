// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/export_poses.h"

#include "bridge/trajectory_text.h"
#include "bridge/transforms_json.h"
#include "scene/error.h"
#include "tests/support/synthetic_model.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;

std::vector<View> MakeViews(CameraModel model = CameraModel::kPinhole) {
  SyntheticModelOptions options;
  options.camera_model = model;
  const Reconstruction scene = MakeSyntheticModel(options);
  std::vector<View> views;
  for (const auto& [id, image] : scene.images) {
    View& view = views.emplace_back();
    view.name = "street/" + image.name;
    view.camera = scene.cameras.at(image.camera_id);
    view.cam_from_world = image.cam_from_world;
  }
  return views;
}

void ExpectInverse(const Rigid3d& world_from_cam, const Rigid3d& cam_from_world) {
  EXPECT_NEAR(
      std::abs(world_from_cam.rotation.dot(cam_from_world.rotation.conjugate())), 1.0, 1e-14);
  EXPECT_LE((world_from_cam.translation - OriginInSource(cam_from_world)).norm(), 1e-13);
}

TEST(TumTrajectory, ReadsBack) {
  const std::vector<View> views = MakeViews();
  const auto by_line = ParseTumTrajectory(TumTrajectory(views, TrajectoryLabel::kLine), "a");
  const auto by_name = ParseTumTrajectory(TumTrajectory(views, TrajectoryLabel::kImageName), "b");
  ASSERT_EQ(by_line.size(), views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(by_line[i].label, std::to_string(i));
    EXPECT_EQ(by_name[i].label, views[i].name);
    ExpectInverse(by_line[i].world_from_cam, views[i].cam_from_world);
    ExpectInverse(by_name[i].world_from_cam, views[i].cam_from_world);
  }
}

TEST(KittiTrajectory, ReadsBack) {
  const std::vector<View> views = MakeViews();
  const auto poses = ParseKittiTrajectory(KittiTrajectory(views), "a");
  ASSERT_EQ(poses.size(), views.size());
  for (size_t i = 0; i < views.size(); ++i) ExpectInverse(poses[i], views[i].cam_from_world);
}

TEST(TransformsJson, ReadsBack) {
  const std::vector<View> views = MakeViews();
  const auto frames = ParseTransformsJson(TransformsJson(views, "images"), "a");
  ASSERT_EQ(frames.size(), views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(frames[i].name, "images/" + views[i].name);
    ExpectInverse(frames[i].world_from_cam, views[i].cam_from_world);
  }
}

// A camera in the world's origin that looks along z with y down: OpenGL's looks along -z, y up.
TEST(TransformsJson, HasOpenGlAxes) {
  View view = MakeViews().front();
  view.cam_from_world = Rigid3d();
  const json text = json::parse(TransformsJson({view}, ""));
  const json expected = {
      {1.0, 0.0, 0.0, 0.0}, {0.0, -1.0, 0.0, 0.0}, {0.0, 0.0, -1.0, 0.0}, {0.0, 0.0, 0.0, 1.0}};
  EXPECT_EQ(text.at("frames").at(0).at("transform_matrix"), expected);
  EXPECT_EQ(text.at("frames").at(0).at("file_path"), view.name);
}

TEST(TransformsJson, NamesEveryParameterOfTheLens) {
  const auto frame = [](CameraModel model) {
    return json::parse(TransformsJson(MakeViews(model), "images")).at("frames").at(0);
  };
  // MakeTestCamera: f = 500 (x: 495 where there are two), c = (318, 243), -0.05, 0.02, 0.003, ...
  const json radial = frame(CameraModel::kRadial);
  EXPECT_EQ(radial.at("camera_model"), "OPENCV");
  EXPECT_EQ(radial.at("fl_x"), 500.0);
  EXPECT_EQ(radial.at("fl_y"), 500.0);
  EXPECT_EQ(radial.at("cx"), 318.0);
  EXPECT_EQ(radial.at("cy"), 243.0);
  EXPECT_EQ(radial.at("w"), 640);
  EXPECT_EQ(radial.at("h"), 480);
  EXPECT_EQ(radial.at("k1"), -0.05);
  EXPECT_EQ(radial.at("k2"), 0.02);
  EXPECT_FALSE(radial.contains("p1"));
  const json opencv = frame(CameraModel::kOpenCV);
  EXPECT_EQ(opencv.at("fl_x"), 495.0);
  EXPECT_EQ(opencv.at("p1"), 0.003);
  EXPECT_EQ(opencv.at("p2"), -0.002);
  const json fisheye = frame(CameraModel::kOpenCVFisheye);
  EXPECT_EQ(fisheye.at("camera_model"), "OPENCV_FISHEYE");
  EXPECT_EQ(fisheye.at("k4"), -0.002);
  EXPECT_THROW(frame(CameraModel::kFullOpenCV), Error);
  EXPECT_THROW(frame(CameraModel::kFOV), Error);
}

}  // namespace
}  // namespace vgtw
