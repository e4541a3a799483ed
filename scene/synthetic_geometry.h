// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"
#include "scene/synthetic_texture.h"

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// point = origin + depth * direction. With a direction whose camera z is 1, depth is z-depth.
struct Ray {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();

  Eigen::Vector3d At(double depth) const { return origin + depth * direction; }
};

enum class ShapeKind {
  kBox,        // |x_i| <= half_size_i in its own frame
  kEllipsoid,  // sum (x_i / half_size_i)^2 <= 1
  kCylinder,   // (x / half_size_0)^2 + (y / half_size_1)^2 <= 1 and |z| <= half_size_2
  kRoom,       // a box seen from inside
  kDome        // an ellipsoid seen from inside
};

struct Solid {
  ShapeKind kind = ShapeKind::kBox;
  Eigen::Matrix3d local_from_world_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d centre_in_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_size = Eigen::Vector3d::Ones();
};

struct Shape : Solid {
  Texture texture;
};

// Upright shape turned by `yaw_rad` around the world's z axis (up).
Shape MakeShape(ShapeKind kind,
                const Eigen::Vector3d& centre_in_world,
                const Eigen::Vector3d& half_size,
                double yaw_rad,
                const Texture& texture);

// The smallest positive depth at which the ray meets the solid's surface from its visible side;
// nothing from the other side.
std::optional<double> Intersect(const Solid& solid, const Ray& ray);

struct SurfacePoint {
  Eigen::Vector3d normal_in_world = Eigen::Vector3d::UnitZ();  // unit, towards the visible side
  int face = 0;                                                // 0..5, of the enclosing box
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();                // on the face, scene units
};
SurfacePoint DescribeSurface(const Solid& solid, const Eigen::Vector3d& point_in_world);

struct Hit {
  double depth = 0.0;
  const Shape* shape = nullptr;
};

// The nearest of the shapes along the ray.
std::optional<Hit> FindNearest(const std::vector<const Shape*>& shapes, const Ray& ray);
std::optional<Hit> FindNearest(const std::vector<Shape>& shapes, const Ray& ray);

}  // namespace vgtw
