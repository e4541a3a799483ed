// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/random.h"
#include "scene/rigid3d.h"
#include "scene/scene_stream_raycast.h"
#include "scene/scene_stream_surface.h"

#include <vector>

#include <Eigen/Core>

namespace vgtw {

enum class BodyKind {
  kPerson,
  kCar,
  kTable,
  kChair,
  kSofa,
  kShelf,
  kCupboard,
  kFloorLamp,
  kPlant,
  kTree,
  kBin,
  kParcel,
  kBall,
  kStack,  // of boxes or books
  kBottle,
  kBench
};

// A compound thing in its own frame: x ahead, z up, origin on the floor below its middle; about as
// large as in life, in metres.
struct Body {
  BodyKind kind = BodyKind::kParcel;
  std::vector<Piece> pieces;
  double radius = 0.0;  // of a cylinder around the z axis that holds it
  double height = 0.0;
};

// Draws a body and appends its surfaces to `surfaces`.
Body MakeBody(BodyKind kind,
              const std::vector<PhotoTexture>& photos,
              RandomStream& random,
              std::vector<Surface>& surfaces);

// Where a body stands: x_in_world = place + size * Rz(yaw) * x_in_body.
struct Stand {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  double yaw_rad = 0.0;
  double size = 1.0;
};
std::vector<Piece> PlaceBody(const Body& body, const Stand& stand);

// The body with its parts grown, shrunk and shifted by up to about `strength` of their size.
Body Deform(const Body& body, double strength, RandomStream& random);

}  // namespace vgtw
