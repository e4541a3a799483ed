// SPDX-License-Identifier: BSD-3-Clause
#include "scene/synthetic_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vgtw {
namespace {

constexpr double kMinDepth = 1e-6;

// Entry and exit of the slabs |x_i| <= half_size_i.
std::optional<double> IntersectSlabs(const Eigen::Vector3d& origin,
                                     const Eigen::Vector3d& direction,
                                     const Eigen::Vector3d& half_size,
                                     bool from_inside) {
  double entry = -std::numeric_limits<double>::infinity();
  double exit = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    // A zero component gives +-infinity, or NaN on the slab's face, which min and max pass over.
    const double inverse = 1.0 / direction[axis];
    const double a = (-half_size[axis] - origin[axis]) * inverse;
    const double b = (half_size[axis] - origin[axis]) * inverse;
    entry = std::max(entry, std::min(a, b));
    exit = std::min(exit, std::max(a, b));
  }
  if (!(entry <= exit)) return std::nullopt;
  const double depth = from_inside ? exit : entry;
  if (depth < kMinDepth) return std::nullopt;
  return depth;
}

std::optional<double> IntersectEllipsoid(const Eigen::Vector3d& origin,
                                         const Eigen::Vector3d& direction,
                                         const Eigen::Vector3d& half_size,
                                         bool from_inside) {
  const Eigen::Vector3d o = origin.cwiseQuotient(half_size);
  const Eigen::Vector3d d = direction.cwiseQuotient(half_size);
  const double a = d.squaredNorm();
  const double b = o.dot(d);
  const double discriminant = b * b - a * (o.squaredNorm() - 1.0);
  if (discriminant < 0.0) return std::nullopt;
  const double root = std::sqrt(discriminant);
  const double depth = (from_inside ? -b + root : -b - root) / a;
  if (depth < kMinDepth) return std::nullopt;
  return depth;
}

std::optional<double> IntersectCylinder(const Eigen::Vector3d& origin,
                                        const Eigen::Vector3d& direction,
                                        const Eigen::Vector3d& half_size) {
  const Eigen::Vector3d o = origin.cwiseQuotient(half_size);
  const Eigen::Vector3d d = direction.cwiseQuotient(half_size);
  const double to_cap1 = (-1.0 - o.z()) / d.z();
  const double to_cap2 = (1.0 - o.z()) / d.z();
  const double a = d.head<2>().squaredNorm();
  const double b = o.head<2>().dot(d.head<2>());
  const double c = o.head<2>().squaredNorm() - 1.0;
  const double discriminant = b * b - a * c;
  const bool is_beside_axis = a == 0.0 && c > 0.0;
  if (discriminant < 0.0 || is_beside_axis) return std::nullopt;
  const double root = std::sqrt(discriminant);
  // Along the axis, inside, the mantle's depths are NaN, which max and min pass over.
  const double entry = std::max(std::min(to_cap1, to_cap2), (-b - root) / a);
  const double exit = std::min(std::max(to_cap1, to_cap2), (-b + root) / a);
  if (!(entry <= exit) || entry < kMinDepth) return std::nullopt;
  return entry;
}

template <typename Shapes, typename Deref>
std::optional<Hit> FindNearestOf(const Shapes& shapes, const Ray& ray, const Deref& deref) {
  Hit nearest{std::numeric_limits<double>::infinity(), nullptr};
  for (const auto& element : shapes) {
    const Shape& shape = deref(element);
    const auto depth = Intersect(shape, ray);
    if (depth && *depth < nearest.depth) nearest = {*depth, &shape};
  }
  if (nearest.shape == nullptr) return std::nullopt;
  return nearest;
}

}  // namespace

Shape MakeShape(ShapeKind kind,
                const Eigen::Vector3d& centre_in_world,
                const Eigen::Vector3d& half_size,
                double yaw_rad,
                const Texture& texture) {
  const Eigen::AngleAxisd world_from_local(yaw_rad, Eigen::Vector3d::UnitZ());
  return {{kind, world_from_local.toRotationMatrix().transpose(), centre_in_world, half_size},
          texture};
}

std::optional<double> Intersect(const Solid& solid, const Ray& ray) {
  const Eigen::Vector3d origin =
      solid.local_from_world_rotation * (ray.origin - solid.centre_in_world);
  const Eigen::Vector3d direction = solid.local_from_world_rotation * ray.direction;
  switch (solid.kind) {
    case ShapeKind::kEllipsoid:
    case ShapeKind::kDome:
      return IntersectEllipsoid(origin, direction, solid.half_size, solid.kind == ShapeKind::kDome);
    case ShapeKind::kCylinder:
      return IntersectCylinder(origin, direction, solid.half_size);
    case ShapeKind::kBox:
    case ShapeKind::kRoom:
      break;
  }
  return IntersectSlabs(origin, direction, solid.half_size, solid.kind == ShapeKind::kRoom);
}

SurfacePoint DescribeSurface(const Solid& solid, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d local =
      solid.local_from_world_rotation * (point_in_world - solid.centre_in_world);
  const Eigen::Vector3d relative = local.cwiseQuotient(solid.half_size);
  int axis = 0;
  relative.cwiseAbs().maxCoeff(&axis);
  const bool is_positive = relative[axis] > 0.0;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  const bool is_ball = solid.kind == ShapeKind::kEllipsoid || solid.kind == ShapeKind::kDome;
  const bool is_mantle =
      solid.kind == ShapeKind::kCylinder && std::abs(relative.z()) < relative.head<2>().norm();
  if (is_ball || is_mantle) {
    normal = relative.cwiseQuotient(solid.half_size);
    if (is_mantle) normal.z() = 0.0;
    normal.normalize();
  } else {
    normal[axis] = is_positive ? 1.0 : -1.0;
  }
  if (solid.kind == ShapeKind::kRoom || solid.kind == ShapeKind::kDome) normal = -normal;
  return {solid.local_from_world_rotation.transpose() * normal,
          2 * axis + (is_positive ? 1 : 0),
          {local[(axis + 1) % 3], local[(axis + 2) % 3]}};
}

std::optional<Hit> FindNearest(const std::vector<const Shape*>& shapes, const Ray& ray) {
  return FindNearestOf(shapes, ray, [](const Shape* shape) -> const Shape& { return *shape; });
}

std::optional<Hit> FindNearest(const std::vector<Shape>& shapes, const Ray& ray) {
  return FindNearestOf(shapes, ray, [](const Shape& shape) -> const Shape& { return shape; });
}

}  // namespace vgtw
