// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/depth_grid.h"

#include "scene/error.h"

#include <cmath>
#include <limits>

namespace vgtw {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

bool HaveSameGrid(const View& a, const View& b) {
  return a.network_width == b.network_width && a.network_height == b.network_height &&
         a.original_from_network.isApprox(b.original_from_network);
}

}  // namespace

DepthMap RegridDepth(const View& from,
                     const DepthMap& depth,
                     const View& onto,
                     double max_relative_step) {
  if (HaveSameGrid(from, onto)) return depth;
  const PixelMap from_original = Inverse(from.original_from_network);
  DepthMap regridded(onto.network_width, onto.network_height, kUnknown);
  for (int y = 0; y < regridded.height(); ++y) {
    for (int x = 0; x < regridded.width(); ++x) {
      const Eigen::Vector2d pixel_in_original =
          Apply(onto.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5));
      const auto value =
          SampleDepth(depth, Apply(from_original, pixel_in_original), max_relative_step);
      if (value) regridded(x, y) = static_cast<float>(*value);
    }
  }
  return regridded;
}

DepthMap ProjectPoints(const View& view, const std::vector<Eigen::Vector3d>& points_in_world) {
  const PixelMap network_from_original = Inverse(view.original_from_network);
  DepthMap depth(view.network_width, view.network_height, kUnknown);
  for (const Eigen::Vector3d& point_in_world : points_in_world) {
    const Eigen::Vector3d point_in_cam = view.cam_from_world * point_in_world;
    const auto pixel_in_original = Project(view.camera, point_in_cam);
    if (!pixel_in_original) continue;
    const Eigen::Vector2d pixel = Apply(network_from_original, *pixel_in_original);
    if (!(pixel.x() >= 0.0 && pixel.x() < depth.width() && pixel.y() >= 0.0 &&
          pixel.y() < depth.height())) {
      continue;
    }
    float& nearest = depth(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
    const auto z = static_cast<float>(point_in_cam.z());
    if (!(nearest <= z)) nearest = z;
  }
  return depth;
}

void AddCommonDepths(const DepthMap& predicted,
                     const DepthMap& expected,
                     double max_depth,
                     DepthPairs& pairs) {
  VGTW_CHECK(predicted.width() == expected.width() && predicted.height() == expected.height(),
             "depth maps of different sizes");
  const auto is_known = [](float depth) { return std::isfinite(depth) && depth > 0.0f; };
  for (size_t i = 0; i < expected.size(); ++i) {
    const float predicted_depth = predicted.data()[i];
    const float expected_depth = expected.data()[i];
    if (!is_known(predicted_depth) || !is_known(expected_depth) || expected_depth > max_depth) {
      continue;
    }
    pairs.predicted.push_back(predicted_depth);
    pairs.expected.push_back(expected_depth);
  }
}

}  // namespace vgtw
