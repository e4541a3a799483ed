// SPDX-License-Identifier: BSD-3-Clause
#include "scene/depth_normals.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

namespace vgtw {
namespace {

// z = 0 where depth is unknown.
Grid<Eigen::Vector3d> PointsInCam(const View& view, const DepthMap& depth) {
  Grid<Eigen::Vector3d> points(depth.width(), depth.height());
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const float z = depth(x, y);
      if (!std::isfinite(z) || z <= 0.0f) continue;
      const auto ray = Unproject(
          view.camera, Apply(view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5)));
      if (ray) points(x, y) = z * ray->homogeneous();
    }
  }
  return points;
}

class NormalMaker {
 public:
  NormalMaker(const Grid<Eigen::Vector3d>& points, double max_relative_step)
      : points_(points), max_relative_step_(max_relative_step) {}

  Eigen::Vector3f At(int x, int y) const {
    if (!(points_(x, y).z() > 0.0)) return Eigen::Vector3f::Zero();
    const Eigen::Vector3d normal = Along(x, y, 1, 0).cross(Along(x, y, 0, 1));
    const double length = normal.norm();
    if (!(length > 0.0)) return Eigen::Vector3f::Zero();
    const double sign = normal.dot(points_(x, y)) < 0.0 ? 1.0 : -1.0;
    return (sign / length * normal).cast<float>();
  }

 private:
  Eigen::Vector3d Along(int x, int y, int dx, int dy) const {
    return Neighbour(x, y, x + dx, y + dy) - Neighbour(x, y, x - dx, y - dy);
  }

  // The point of the neighbour at (i, j), or of (x, y) itself where that is on another surface.
  const Eigen::Vector3d& Neighbour(int x, int y, int i, int j) const {
    const Eigen::Vector3d& own = points_(x, y);
    if (!points_.Contains(i, j)) return own;
    const Eigen::Vector3d& other = points_(i, j);
    const double step = std::abs(other.z() - own.z());
    return step <= max_relative_step_ * std::min(own.z(), other.z()) ? other : own;
  }

  const Grid<Eigen::Vector3d>& points_;
  double max_relative_step_;
};

}  // namespace

Grid<Eigen::Vector3f> NormalsFromDepth(const View& view,
                                       const DepthMap& depth,
                                       double max_relative_step) {
  const Grid<Eigen::Vector3d> points = PointsInCam(view, depth);
  const NormalMaker maker(points, max_relative_step);
  Grid<Eigen::Vector3f> normals(depth.width(), depth.height());
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) normals(x, y) = maker.At(x, y);
  }
  return normals;
}

}  // namespace vgtw
