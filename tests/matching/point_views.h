// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/view_features.h"
#include "scene/random.h"

#include <cmath>
#include <string>
#include <vector>

namespace vgtw {

// Features of views on an arc that look at a cloud of points, each of which has a descriptor of its
// own: keypoint i of every view is point i, its depth is exact.
inline std::vector<ViewFeatures> MakePointViews(size_t num_views, size_t num_points) {
  RandomStream random(7);
  std::vector<Eigen::Vector3d> points;
  Descriptors descriptors{static_cast<uint32_t>(num_points), 128, 0, {}};
  for (size_t i = 0; i < num_points; ++i) {
    const double x = random.Uniform(-1.0, 1.0);
    const double y = random.Uniform(-1.0, 1.0);
    const double z = random.Uniform(-1.0, 1.0);
    points.emplace_back(x, y, z);
    for (int k = 0; k < 128; ++k) descriptors.data.push_back(random.Bits() & 127);
  }
  std::vector<ViewFeatures> views;
  for (size_t v = 0; v < num_views; ++v) {
    View view;
    view.name = std::to_string(v);
    view.camera = MakePinhole(640, 480, 500.0, 500.0);
    const double angle = 0.15 * static_cast<double>(v);
    view.cam_from_world =
        LookAt({5.0 * std::sin(angle), 0.0, -5.0 * std::cos(angle)}, {0, 0, 0}, {0, -1, 0});
    Keypoints keypoints{static_cast<uint32_t>(num_points), 2, {}};
    std::vector<float> depths;
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3d point_in_cam = view.cam_from_world * point;
      const Eigen::Vector2d pixel = Project(view.camera, point_in_cam).value();
      keypoints.data.push_back(static_cast<float>(pixel.x()));
      keypoints.data.push_back(static_cast<float>(pixel.y()));
      depths.push_back(static_cast<float>(point_in_cam.z()));
    }
    views.push_back(MakeViewFeatures(view, {keypoints, descriptors}, nullptr));
    views.back().depths = depths;
    views.back().depth_confs.assign(num_points, 1.0f);
  }
  return views;
}

}  // namespace vgtw
