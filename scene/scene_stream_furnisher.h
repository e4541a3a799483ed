// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/scene_stream_stage.h"

#include <numbers>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Draws the numbers and adds the static pieces of a stage. At most one argument of a call may draw:
// their order of evaluation is the compiler's.
class Furnisher {
 public:
  Furnisher(const std::vector<PhotoTexture>& photos, RandomStream& random, Stage& stage)
      : photos_(photos), random_(random), stage_(stage) {}

  // A new surface; returns its index.
  int Look(SurfaceUse use, double size);
  Body Make(BodyKind kind) { return MakeBody(kind, photos_, random_, stage_.surfaces); }

  Solid& Add(ShapeKind kind,
             const Eigen::Vector3d& centre,
             const Eigen::Vector3d& half_size,
             int surface);
  Solid& AddBox(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_size, int surface) {
    return Add(ShapeKind::kBox, centre, half_size, surface);
  }

  void Place(const Body& body, const Stand& stand);
  // Somewhere on the floor if a free place is found soon; else the body is left out.
  void Scatter(const Body& body, double size);
  void ScatterThings(size_t num_things);
  Eigen::Vector2d DrawPlaceOnFloor();

  double Draw(double min, double max) { return random_.Uniform(min, max); }
  double DrawYaw() { return Draw(0.0, 2.0 * std::numbers::pi); }
  bool Chance(double probability) { return random_.Chance(probability); }
  size_t Index(size_t n) { return random_.Index(n); }
  Stage& stage() { return stage_; }

 private:
  const std::vector<PhotoTexture>& photos_;
  RandomStream& random_;
  Stage& stage_;
};

void FurnishRoom(Furnisher& furnisher);
void FurnishTable(Furnisher& furnisher);
void FurnishStreet(Furnisher& furnisher);
void FurnishFacade(Furnisher& furnisher);

}  // namespace vgtw
