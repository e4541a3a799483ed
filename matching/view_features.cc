// SPDX-License-Identifier: BSD-3-Clause
#include "matching/view_features.h"

#include "scene/error.h"

#include <limits>
#include <utility>

namespace vgtw {

Eigen::Vector3d ViewFeatures::PointInWorld(size_t idx) const {
  const Eigen::Vector3d ray = rays[idx].cast<double>().homogeneous();
  return Inverse(view.cam_from_world) * (static_cast<double>(depths[idx]) * ray);
}

ViewFeatures MakeViewFeatures(const View& view,
                              Features features,
                              const StaticView* static_view,
                              double confidence_threshold) {
  const Keypoints& keypoints = features.keypoints;
  VGTW_CHECK(features.descriptors.rows == 0 || features.descriptors.rows == keypoints.rows,
             "a descriptor per keypoint");
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  ViewFeatures result;
  result.view = view;
  result.pixels.reserve(keypoints.rows);
  result.rays.assign(keypoints.rows, Eigen::Vector2f(kNaN, kNaN));
  result.scales.reserve(keypoints.rows);
  result.depths.assign(keypoints.rows, kNaN);
  result.depth_confs.assign(keypoints.rows, 0.0f);
  for (size_t i = 0; i < keypoints.rows; ++i) {
    const Eigen::Vector2d pixel(keypoints.x(i), keypoints.y(i));
    result.pixels.push_back(pixel.cast<float>());
    result.scales.push_back(keypoints.Scale(i));
    const auto ray = Unproject(view.camera, pixel);
    if (!ray) continue;
    result.rays[i] = ray->cast<float>();
    const auto depth = static_view ? static_view->DepthAt(pixel) : std::nullopt;
    if (!depth || !(depth->confidence >= confidence_threshold)) continue;
    result.depths[i] = depth->depth;
    result.depth_confs[i] = depth->confidence;
  }
  result.descriptors = std::move(features.descriptors);
  return result;
}

}  // namespace vgtw
