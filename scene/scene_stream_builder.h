// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/scene_stream_bodies.h"

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vgtw {

// Draws the numbers and adds the pieces of one body. At most one argument of a call may draw: their
// order of evaluation is the compiler's.
class BodyBuilder {
 public:
  BodyBuilder(const std::vector<PhotoTexture>& photos,
              RandomStream& random,
              std::vector<Surface>& surfaces)
      : random_(random), photos_(photos), surfaces_(surfaces) {}

  // A new surface; returns its index.
  int Look(SurfaceUse use, double size);

  Solid& Add(ShapeKind kind,
             const Eigen::Vector3d& centre,
             const Eigen::Vector3d& half_size,
             int surface);
  Solid& AddBox(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_size, int surface) {
    return Add(ShapeKind::kBox, centre, half_size, surface);
  }
  Solid& AddBall(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_size, int surface) {
    return Add(ShapeKind::kEllipsoid, centre, half_size, surface);
  }
  // Upright; `foot` is the middle of its lower cap.
  Solid& AddColumn(const Eigen::Vector3d& foot, double radius, double height, int surface);
  // Four legs at the corners of a rectangle.
  void AddLegs(const Eigen::Vector2d& half_size, double thickness, double height, int surface);
  // Balls of leaves around a point.
  void AddCrown(double radius, double height, size_t num_balls);

  double Draw(double min, double max) { return random_.Uniform(min, max); }
  bool Chance(double probability) { return random_.Chance(probability); }
  size_t Index(size_t n) { return random_.Index(n); }

  Body Finish(BodyKind kind);

 private:
  RandomStream& random_;
  const std::vector<PhotoTexture>& photos_;
  std::vector<Surface>& surfaces_;
  Body body_;
};

// Turns a solid around an axis of the body through the solid's centre.
void Turn(Solid& solid, double angle_rad, const Eigen::Vector3d& axis);

void BuildTable(BodyBuilder& builder);
void BuildChair(BodyBuilder& builder);
void BuildSofa(BodyBuilder& builder);
void BuildShelf(BodyBuilder& builder);
void BuildCupboard(BodyBuilder& builder);
void BuildFloorLamp(BodyBuilder& builder);
void BuildBench(BodyBuilder& builder);

}  // namespace vgtw
