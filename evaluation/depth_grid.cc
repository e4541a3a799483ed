// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/depth_grid.h"

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

}  // namespace vgtw
