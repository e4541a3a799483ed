// SPDX-License-Identifier: BSD-3-Clause
#include "scene/network_pixels.h"

#include <cmath>
#include <limits>

namespace vgtw {

std::optional<Camera> CameraFromNetwork(const Eigen::Matrix3d& network_intrinsics,
                                        const NetworkGeometry& geometry,
                                        const ImageSize& photo_size) {
  const Eigen::Matrix3d& k = network_intrinsics;
  constexpr double kTolerance = 1e-3;
  if (!k.allFinite() || k(0, 0) <= 0.0 || k(1, 1) <= 0.0) return std::nullopt;
  if (std::abs(k(0, 1)) > kTolerance * k(0, 0) || std::abs(k(1, 0)) > kTolerance * k(1, 1) ||
      !k.row(2).isApprox(Eigen::RowVector3d(0.0, 0.0, 1.0), kTolerance)) {
    return std::nullopt;
  }
  const PixelMap& map = geometry.original_from_network;
  Camera camera =
      MakePinhole(photo_size.width, photo_size.height, map(0, 0) * k(0, 0), map(1, 1) * k(1, 1));
  camera.SetPrincipalPoint(Apply(map, {k(0, 2), k(1, 2)}));
  camera.has_prior_focal_length = true;
  return camera;
}

bool IsOnPhoto(const NetworkGeometry& geometry, const ImageSize& size, int x, int y) {
  const Eigen::Vector2d pixel =
      Apply(geometry.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5));
  return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= static_cast<double>(size.width) &&
         pixel.y() <= static_cast<double>(size.height);
}

void ForgetBars(ViewPrediction& prediction) {
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  const View& view = prediction.view;
  const NetworkGeometry geometry = {
      view.network_width, view.network_height, view.original_from_network};
  const ImageSize photo_size = {view.camera.width, view.camera.height};
  for (int y = 0; y < geometry.network_height; ++y) {
    for (int x = 0; x < geometry.network_width; ++x) {
      if (IsOnPhoto(geometry, photo_size, x, y)) continue;
      if (!prediction.depth.empty()) prediction.depth(x, y) = kUnknown;
      if (!prediction.depth_conf.empty()) prediction.depth_conf(x, y) = kUnknown;
      if (!prediction.distractor.empty()) prediction.distractor(x, y) = kUnknown;
      if (!prediction.points.empty()) prediction.points(x, y).setConstant(kUnknown);
    }
  }
}

}  // namespace vgtw
