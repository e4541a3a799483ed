// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison_pictures.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/sim3d.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using nlohmann::json;

std::vector<uint8_t> FromBase64(const std::string& text) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<uint8_t> bytes;
  uint32_t bits = 0;
  int num_bits = 0;
  for (const char c : text.substr(0, text.find('='))) {
    bits = (bits << 6) | static_cast<uint32_t>(digits.find(c));
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes.push_back(static_cast<uint8_t>(bits >> num_bits));
  }
  return bytes;
}

Eigen::Vector3d AsVector(const json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

std::vector<Eigen::Vector3d> Unpack(const json& points) {
  const std::vector<uint8_t> bytes = FromBase64(points.at("xyz"));
  std::vector<Eigen::Vector3d> xyz;
  for (size_t i = 0; i < points.at("count"); ++i) {
    Eigen::Vector3d q;
    for (size_t axis = 0; axis < 3; ++axis) {
      q[static_cast<int>(axis)] = bytes[6 * i + 2 * axis] + 256.0 * bytes[6 * i + 2 * axis + 1];
    }
    xyz.push_back(AsVector(points.at("min")) + AsVector(points.at("step")).cwiseProduct(q));
  }
  return xyz;
}

// The same scene twice, the second in another world.
ComparisonInputs MakeInputs() {
  const Reconstruction model = MakeSyntheticModel({});
  Sim3d change;
  change.scale = 2.5;
  change.rotation = Eigen::AngleAxisd(0.8, Eigen::Vector3d(1.0, -2.0, 0.5).normalized());
  change.translation = {3.0, -7.0, 1.0};
  Reconstruction moved = model;
  for (auto& [id, image] : moved.images) {
    image.cam_from_world = TransformCamera(change, image.cam_from_world);
  }
  for (auto& [id, point] : moved.points3D) point.xyz = change * point.xyz;
  ComparisonInputs inputs;
  inputs.models = {{"a", "a/", model}, {"b", "b/", moved}};
  return inputs;
}

TEST(AddPictures, AllModelsAreInOneWorld) {
  const ComparisonInputs inputs = MakeInputs();
  const Reconstruction& model = inputs.models.front().model;
  json comparison = CompareModels(inputs);
  AddPictures(inputs, comparison);
  const json& scene = comparison.at("scene");
  for (const json& placed : scene.at("models")) {
    const std::vector<Eigen::Vector3d> points = Unpack(placed.at("points"));
    ASSERT_EQ(points.size(), model.points3D.size());
    // Half a step of rounding, and that of the alignment.
    const Eigen::Vector3d step = AsVector(placed.at("points").at("step"));
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d off = points[i] - model.points3D.at(i + 1).xyz;
      EXPECT_LE((off.cwiseAbs() - 0.501 * step).maxCoeff(), 0.0) << i;
    }
    ASSERT_EQ(placed.at("cameras").size(), 6u);
    for (const json& camera : placed.at("cameras")) {
      const std::string name =
          comparison.at("views").at(camera.at("view").get<size_t>()).at("name");
      const auto image = std::find_if(model.images.begin(), model.images.end(), [&](const auto& e) {
        return e.second.name == name;
      });
      const Rigid3d& pose = image->second.cam_from_world;
      EXPECT_LE((AsVector(camera.at("centre")) - OriginInSource(pose)).norm(), 1e-9);
      const json& wxyz = camera.at("rotation_wxyz");
      const Eigen::Quaterniond rotation(wxyz.at(0).get<double>(),
                                        wxyz.at(1).get<double>(),
                                        wxyz.at(2).get<double>(),
                                        wxyz.at(3).get<double>());
      EXPECT_NEAR(std::abs(rotation.dot(pose.rotation.conjugate())), 1.0, 1e-12);
    }
  }
  EXPECT_LE((AsVector(scene.at("centre")) - Eigen::Vector3d(0.0, 0.0, -1.0)).norm(), 2.0);
  // Cameras stand upright, y down.
  EXPECT_LT(AsVector(scene.at("up")).y(), -0.9);
}

TEST(AddPictures, PointsAreThinnedEvenly) {
  ComparisonInputs inputs = MakeInputs();
  inputs.max_num_points = 50;
  json comparison = CompareModels(inputs);
  AddPictures(inputs, comparison);
  for (const json& placed : comparison.at("scene").at("models")) {
    EXPECT_EQ(placed.at("points").at("count"), 40);  // every third of 120
  }
}

TEST(AddPictures, TheReferenceIsAModelOfCamerasOnly) {
  ComparisonInputs inputs = MakeInputs();
  inputs.reference = CamFromWorldByName(inputs.models.front().model);
  inputs.reference.erase("image2.jpg");
  json comparison = CompareModels(inputs);
  AddPictures(inputs, comparison);
  ASSERT_EQ(comparison.at("models").size(), 3u);
  EXPECT_EQ(comparison.at("models").at(2).at("role"), "reference");
  EXPECT_TRUE(comparison.at("models").at(2).at("median_px").is_null());
  EXPECT_EQ(comparison.at("scene").at("models").at(2).at("cameras").size(), 5u);
  EXPECT_TRUE(comparison.at("scene").at("models").at(2).at("points").is_null());
  for (const json& view : comparison.at("views")) {
    EXPECT_EQ(view.at("by_model").size(), 3u);
    EXPECT_TRUE(view.at("by_model").at(2).is_null());
  }
}

TEST(AddPictures, PhotosShowWhatIsUsed) {
  const TemporaryFolder folder;
  ComparisonInputs inputs = MakeInputs();
  inputs.image_path = folder.path();
  WriteImage(folder / "image1.jpg", RgbImage(640, 480, Rgb{128, 128, 128}));
  json comparison = CompareModels(inputs);
  AddPictures(inputs, comparison);
  const json& view = comparison.at("views").at(0);
  const std::string prefix = "data:image/jpeg;base64,";
  const auto read = [&](const std::string& url) {
    EXPECT_TRUE(url.starts_with(prefix));
    const std::vector<uint8_t> bytes = FromBase64(url.substr(prefix.size()));
    WriteFileAtomically(folder / "read.jpg", std::string(bytes.begin(), bytes.end()));
    return ReadRgbImage(folder / "read.jpg");
  };
  const RgbImage thumbnail = read(view.at("thumbnail"));
  const RgbImage overlay = read(view.at("overlay"));
  EXPECT_EQ(thumbnail.width(), 360);
  EXPECT_EQ(thumbnail.height(), 270);
  size_t num_green = 0;
  for (const Point2D& point2D : inputs.models.back().model.images.at(1).points2D) {
    const Eigen::Vector2i pixel = (point2D.xy * (360.0 / 640.0)).cast<int>();
    const Rgb& color = overlay(pixel.x(), pixel.y());
    num_green += color[1] > 150 && color[0] < 120;
    EXPECT_EQ(thumbnail(pixel.x(), pixel.y()), (Rgb{128, 128, 128}));
  }
  EXPECT_GT(num_green, 100u);  // of 120; JPEG blurs some of their colours
  EXPECT_TRUE(comparison.at("views").at(1).at("thumbnail").is_null());
}

}  // namespace
}  // namespace vgtw
