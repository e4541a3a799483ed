// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_builder.h"

#include <algorithm>

namespace vgtw {

int BodyBuilder::Look(SurfaceUse use, double size) {
  surfaces_.push_back(MakeSurface(use, size, photos_, random_));
  return static_cast<int>(surfaces_.size()) - 1;
}

Solid& BodyBuilder::Add(ShapeKind kind,
                        const Eigen::Vector3d& centre,
                        const Eigen::Vector3d& half_size,
                        int surface) {
  body_.pieces.push_back({{kind, Eigen::Matrix3d::Identity(), centre, half_size}, surface});
  return body_.pieces.back().solid;
}

Solid& BodyBuilder::AddColumn(const Eigen::Vector3d& foot,
                              double radius,
                              double height,
                              int surface) {
  const Eigen::Vector3d centre = foot + 0.5 * height * Eigen::Vector3d::UnitZ();
  return Add(ShapeKind::kCylinder, centre, {radius, radius, 0.5 * height}, surface);
}

void BodyBuilder::AddLegs(const Eigen::Vector2d& half_size,
                          double thickness,
                          double height,
                          int surface) {
  for (const double x : {-1.0, 1.0}) {
    for (const double y : {-1.0, 1.0}) {
      AddBox({x * (half_size.x() - thickness), y * (half_size.y() - thickness), 0.5 * height},
             {thickness, thickness, 0.5 * height},
             surface);
    }
  }
}

void BodyBuilder::AddCrown(double radius, double height, size_t num_balls) {
  for (size_t i = 0; i < num_balls; ++i) {
    const double size = radius * Draw(0.45, 0.8);
    const Eigen::Vector3d offset{Draw(-0.6, 0.6), Draw(-0.6, 0.6), Draw(-0.5, 0.6)};
    const double flatness = Draw(0.7, 1.1);
    AddBall(Eigen::Vector3d(0.0, 0.0, height) + radius * offset,
            {size, size, size * flatness},
            Look(SurfaceUse::kFoliage, 0.6 * radius));
  }
}

Body BodyBuilder::Finish(BodyKind kind) {
  body_.kind = kind;
  for (const Piece& piece : body_.pieces) {
    const Solid& solid = piece.solid;
    const Eigen::Vector3d reach =
        solid.local_from_world_rotation.transpose().cwiseAbs() * solid.half_size;
    const Eigen::Vector3d far = solid.centre_in_world.cwiseAbs() + reach;
    body_.radius = std::max(body_.radius, far.head<2>().norm());
    body_.height = std::max(body_.height, solid.centre_in_world.z() + reach.z());
  }
  return std::move(body_);
}

void Turn(Solid& solid, double angle_rad, const Eigen::Vector3d& axis) {
  solid.local_from_world_rotation =
      solid.local_from_world_rotation * Eigen::AngleAxisd(-angle_rad, axis).toRotationMatrix();
}

}  // namespace vgtw
