// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"
#include "tests/bridge/numpy_files.h"

#include <string>
#include <vector>

namespace vgtw {

inline constexpr size_t kNumSceneViews = 3;

inline Rigid3d WorldFromCam(size_t view) {
  const auto i = static_cast<double>(view);
  return {RotationAboutAxis(Eigen::Vector3d(0.2, 1, 0.1 * i).normalized(), 8.0 * i),
          {0.7 * i, -0.2 * i, 0.3 - 0.1 * i}};
}

// What a network says of kNumSceneViews photos of one size, as its demo's arrays. Values are those
// of a scene of bumpy depth through the pinhole (fx, fy, W/2, H/2).
struct SampleScene {
  int width;
  int height;
  double fx;
  double fy;
  std::vector<float> poses = {};   // [S,4,4] world_from_cam
  std::vector<float> depth = {};   // [S,H,W]
  std::vector<float> points = {};  // [S,H,W,3] in the world

  SampleScene(
      int map_width, int map_height, double focal_x, double focal_y, bool is_inverted = false)
      : width(map_width), height(map_height), fx(focal_x), fy(focal_y) {
    for (size_t i = 0; i < kNumSceneViews; ++i) {
      const Rigid3d world_from_cam = WorldFromCam(i);
      const Rigid3d written = is_inverted ? Inverse(world_from_cam) : world_from_cam;
      Eigen::Matrix<float, 4, 4, Eigen::RowMajor> matrix = decltype(matrix)::Identity();
      matrix.topRows<3>() = written.ToMatrix().cast<float>();
      poses.insert(poses.end(), matrix.data(), matrix.data() + 16);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) AddPixel(world_from_cam, x, y);
      }
    }
  }
  void AddPixel(const Rigid3d& world_from_cam, int x, int y) {
    const double z = 3.0 + 0.25 * ((2 * x + 3 * y) % 9);
    depth.push_back(static_cast<float>(z));
    const Eigen::Vector3f point =
        (world_from_cam *
         Eigen::Vector3d((x + 0.5 - 0.5 * width) / fx * z, (y + 0.5 - 0.5 * height) / fy * z, z))
            .cast<float>();
    points.insert(points.end(), point.data(), point.data() + 3);
  }
  size_t NumPixels() const { return depth.size() / kNumSceneViews; }
  // "(3, H, W" + rest
  std::string Shape(const std::string& rest) const {
    return "(3, " + std::to_string(height) + ", " + std::to_string(width) + rest;
  }
  std::string Poses() const { return NpyFloats("(3, 4, 4)", poses); }
  std::string Points() const { return NpyFloats(Shape(", 3)"), points); }
  std::string Map(float value) const {
    return NpyFloats(Shape(")"), std::vector<float>(depth.size(), value));
  }
};

}  // namespace vgtw
