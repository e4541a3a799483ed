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
                                         const Eigen::Vector3d& half_size) {
  const Eigen::Vector3d o = origin.cwiseQuotient(half_size);
  const Eigen::Vector3d d = direction.cwiseQuotient(half_size);
  const double a = d.squaredNorm();
  const double b = o.dot(d);
  const double discriminant = b * b - a * (o.squaredNorm() - 1.0);
  if (discriminant < 0.0) return std::nullopt;
  const double depth = (-b - std::sqrt(discriminant)) / a;
  if (depth < kMinDepth) return std::nullopt;
  return depth;
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
  return {
      kind, world_from_local.toRotationMatrix().transpose(), centre_in_world, half_size, texture};
}

std::optional<double> Intersect(const Shape& shape, const Ray& ray) {
  const Eigen::Vector3d origin =
      shape.local_from_world_rotation * (ray.origin - shape.centre_in_world);
  const Eigen::Vector3d direction = shape.local_from_world_rotation * ray.direction;
  if (shape.kind == ShapeKind::kEllipsoid) {
    return IntersectEllipsoid(origin, direction, shape.half_size);
  }
  return IntersectSlabs(origin, direction, shape.half_size, shape.kind == ShapeKind::kRoom);
}

SurfacePoint DescribeSurface(const Shape& shape, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d local =
      shape.local_from_world_rotation * (point_in_world - shape.centre_in_world);
  const Eigen::Vector3d relative = local.cwiseQuotient(shape.half_size);
  int axis = 0;
  relative.cwiseAbs().maxCoeff(&axis);
  const bool is_positive = relative[axis] > 0.0;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  if (shape.kind == ShapeKind::kEllipsoid) {
    normal = relative.cwiseQuotient(shape.half_size).normalized();
  } else {
    const double outwards = is_positive ? 1.0 : -1.0;
    normal[axis] = shape.kind == ShapeKind::kRoom ? -outwards : outwards;
  }
  return {shape.local_from_world_rotation.transpose() * normal,
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
