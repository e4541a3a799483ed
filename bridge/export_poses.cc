// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/export_poses.h"

#include "scene/error.h"

#include <array>
#include <charconv>
#include <cstddef>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;

// As short as it can be read back exactly.
std::string Text(double value) {
  std::array<char, 32> buffer;
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

struct ModelWords {
  CameraModel model;
  const char* name;                         // nerfstudio's
  std::array<const char*, 4> extra_params;  // in COLMAP's order; nullptr = no more
};

constexpr ModelWords kModelWords[] = {
    {CameraModel::kSimplePinhole, "OPENCV", {}},
    {CameraModel::kPinhole, "OPENCV", {}},
    {CameraModel::kSimpleRadial, "OPENCV", {"k1"}},
    {CameraModel::kRadial, "OPENCV", {"k1", "k2"}},
    {CameraModel::kOpenCV, "OPENCV", {"k1", "k2", "p1", "p2"}},
    {CameraModel::kOpenCVFisheye, "OPENCV_FISHEYE", {"k1", "k2", "k3", "k4"}},
};

json Lens(const View& view) {
  const Camera& camera = view.camera;
  const CameraModelInfo& info = GetCameraModelInfo(camera.model);
  for (const ModelWords& words : kModelWords) {
    if (words.model != camera.model) continue;
    const Eigen::Vector2d principal_point = camera.PrincipalPoint();
    json lens = {{"camera_model", words.name},
                 {"fl_x", camera.FocalLengthX()},
                 {"fl_y", camera.FocalLengthY()},
                 {"cx", principal_point.x()},
                 {"cy", principal_point.y()},
                 {"w", camera.width},
                 {"h", camera.height}};
    const auto num_first = static_cast<size_t>(info.num_focal_lengths) + 2;
    for (size_t i = 0; i < words.extra_params.size() && words.extra_params[i]; ++i) {
      lens[words.extra_params[i]] = camera.params[num_first + i];
    }
    return lens;
  }
  Fail(view.name,
       "has a camera of model " + std::string(info.name),
       "one of transforms.json: up to OPENCV or OPENCV_FISHEYE",
       "undistort the photos first, by colmap image_undistorter");
}

}  // namespace

std::string TumTrajectory(const std::vector<View>& views, TrajectoryLabel label) {
  std::string text = "# world_from_cam: label tx ty tz qx qy qz qw\n";
  for (size_t i = 0; i < views.size(); ++i) {
    const Rigid3d world_from_cam = Inverse(views[i].cam_from_world);
    text += label == TrajectoryLabel::kLine ? std::to_string(i) : views[i].name;
    for (const double value : world_from_cam.translation) text += " " + Text(value);
    for (const double value : world_from_cam.rotation.coeffs()) text += " " + Text(value);
    text += "\n";
  }
  return text;
}

std::string KittiTrajectory(const std::vector<View>& views) {
  std::string text;
  for (const View& view : views) {
    const Eigen::Matrix<double, 3, 4> matrix = Inverse(view.cam_from_world).ToMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        text += (row + column > 0 ? " " : "") + Text(matrix(row, column));
      }
    }
    text += "\n";
  }
  return text;
}

std::string TransformsJson(const std::vector<View>& views, const std::string& image_folder) {
  json frames = json::array();
  for (const View& view : views) {
    Eigen::Matrix<double, 3, 4> matrix = Inverse(view.cam_from_world).ToMatrix();
    matrix.col(1) = -matrix.col(1);
    matrix.col(2) = -matrix.col(2);
    json rows = json::array();
    for (int row = 0; row < 3; ++row) {
      rows.push_back({matrix(row, 0), matrix(row, 1), matrix(row, 2), matrix(row, 3)});
    }
    rows.push_back({0.0, 0.0, 0.0, 1.0});
    json frame = Lens(view);
    frame["file_path"] = image_folder.empty() ? view.name : image_folder + "/" + view.name;
    frame["transform_matrix"] = std::move(rows);
    frames.push_back(std::move(frame));
  }
  return json{{"frames", std::move(frames)}}.dump(2) + "\n";
}

}  // namespace vgtw
