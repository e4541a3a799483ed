// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/random.h"
#include "scene/scene_stream_bodies.h"
#include "scene/scene_stream_surface.h"

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vgtw {

enum class Layout { kRoom, kTable, kStreet, kFacade };

// A body of the scene and how large its kind is there: cars are toys on a table.
struct CastMember {
  Body body;
  double size = 1.0;
};

// A disc on the floor.
struct Footprint {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double radius = 0.0;
};

// The static scene and where cameras and distractors may be in it; z up, scene units.
struct Stage {
  Layout layout = Layout::kRoom;
  std::vector<Surface> surfaces;
  std::vector<Piece> pieces;

  // Bodies stand on this rectangle.
  Eigen::AlignedBox2d floor;
  double floor_height = 0.0;
  std::vector<Footprint> footprints;  // of what stands there

  // Cameras look at the target from `distance`, seen under these angles, and stay in `space`.
  Eigen::Vector3d target = Eigen::Vector3d::Zero();
  double azimuth_deg = 0.0;
  double elevation_deg = 0.0;
  double distance = 1.0;
  Eigen::AlignedBox3d space;
  double min_depth = 0.1;  // nothing static is nearer to a camera

  bool IsFree(const Eigen::Vector2d& place, double radius) const;
};

// Draws the bodies that may be distractors in a scene of this layout; their surfaces go to
// stage.surfaces. `kinds` are bits of DistractorKind.
std::vector<CastMember> DrawCast(uint32_t kinds,
                                 const std::vector<PhotoTexture>& photos,
                                 RandomStream& random,
                                 Stage& stage);

// Builds the static scene of stage.layout. Members of `look_alikes` stand in it among others.
void FurnishStage(const std::vector<CastMember>& look_alikes,
                  const std::vector<PhotoTexture>& photos,
                  RandomStream& random,
                  Stage& stage);

}  // namespace vgtw
