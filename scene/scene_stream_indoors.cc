// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_furnisher.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vgtw {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Walls, floor and ceiling as slabs, within a room that closes what they leave open.
void AddWalls(Furnisher& furnisher, const Vector3d& half_size) {
  constexpr double kThickness = 0.1;
  const int floor = furnisher.Look(SurfaceUse::kFloor, 2.0);
  const int ceiling = furnisher.Look(SurfaceUse::kCeiling, 2.0);
  const int wall = furnisher.Look(SurfaceUse::kWall, 2.0);
  const int other_wall = furnisher.Chance(0.4) ? furnisher.Look(SurfaceUse::kWall, 2.0) : wall;
  const double x = half_size.x();
  const double y = half_size.y();
  const double z = half_size.z();
  const Vector3d outer_half_size = half_size.array() + 2.0 * kThickness;
  furnisher.Add(ShapeKind::kRoom, {0.0, 0.0, z}, outer_half_size, ceiling);
  furnisher.AddBox({0.0, 0.0, -kThickness}, {x, y, kThickness}, floor);
  furnisher.AddBox({0.0, 0.0, 2.0 * z + kThickness}, {x, y, kThickness}, ceiling);
  for (const double side : {-1.0, 1.0}) {
    const int across = side > 0.0 ? other_wall : wall;
    furnisher.AddBox({side * (x + kThickness), 0.0, z}, {kThickness, y, z}, wall);
    furnisher.AddBox({0.0, side * (y + kThickness), z}, {x, kThickness, z}, across);
  }
}

// A place at a wall of a room around the origin; yaw turns x into the room.
struct WallPlace {
  Vector2d place;
  Vector2d inwards;
  double yaw_rad;
};

WallPlace DrawWallPlace(Furnisher& furnisher, const Vector3d& half_size, double margin) {
  const size_t side = furnisher.Index(4);
  const double yaw_rad = 0.5 * std::numbers::pi * static_cast<double>(side);
  const Vector2d inwards(std::cos(yaw_rad), std::sin(yaw_rad));
  const Vector2d along(-inwards.y(), inwards.x());
  const bool is_x = side % 2 == 0;
  const double to_wall = is_x ? half_size.x() : half_size.y();
  const double reach = std::max(0.0, (is_x ? half_size.y() : half_size.x()) - margin);
  return {-to_wall * inwards + furnisher.Draw(-reach, reach) * along, inwards, yaw_rad};
}

void AddPictures(Furnisher& furnisher, const Vector3d& half_size, size_t num_pictures) {
  for (size_t i = 0; i < num_pictures; ++i) {
    const WallPlace wall = DrawWallPlace(furnisher, half_size, 0.6);
    const double width = furnisher.Draw(0.2, 0.6);
    const double height = furnisher.Draw(0.2, 0.5);
    const double z = half_size.z() * furnisher.Draw(0.9, 1.4);
    const int look = furnisher.Look(SurfaceUse::kPicture, width);
    const int frame = furnisher.Look(SurfaceUse::kWood, 0.3);
    for (const bool is_frame : {true, false}) {
      const double border = is_frame ? 0.04 : 0.0;
      Solid& solid = furnisher.AddBox({wall.place.x(), wall.place.y(), z},
                                      {is_frame ? 0.02 : 0.03, width + border, height + border},
                                      is_frame ? frame : look);
      solid.local_from_world_rotation =
          Eigen::AngleAxisd(-wall.yaw_rad, Vector3d::UnitZ()).toRotationMatrix();
    }
  }
}

void AddWallFurniture(Furnisher& furnisher, const Vector3d& half_size, size_t num_bodies) {
  using enum BodyKind;
  constexpr std::array kKinds = {
      kShelf, kShelf, kCupboard, kCupboard, kSofa, kPlant, kFloorLamp, kTable};
  for (size_t i = 0; i < num_bodies; ++i) {
    const Body body = furnisher.Make(kKinds[furnisher.Index(kKinds.size())]);
    const WallPlace wall = DrawWallPlace(furnisher, half_size, 0.8);
    const Vector2d place = wall.place + std::min(0.45, 0.8 * body.radius) * wall.inwards;
    if (!furnisher.stage().IsFree(place, 0.8 * body.radius)) continue;
    furnisher.Place(body, {{place.x(), place.y(), 0.0}, wall.yaw_rad, 1.0});
  }
}

// Something flat on the floor or on a table top.
void AddSheet(Furnisher& furnisher, SurfaceUse use, const Vector2d& half_size, double thickness) {
  const Vector2d place = 0.3 * furnisher.DrawPlaceOnFloor();
  const int look = furnisher.Look(use, half_size.x());
  furnisher.AddBox({place.x(), place.y(), furnisher.stage().floor_height},
                   {half_size.x(), half_size.y(), thickness},
                   look);
}

// A top on two boards, as the floor of the stage.
void AddTable(Furnisher& furnisher, const Vector2d& half_top, double height) {
  const SurfaceUse use = furnisher.Chance(0.7) ? SurfaceUse::kWood : SurfaceUse::kThing;
  const int look = furnisher.Look(use, 0.6);
  furnisher.AddBox({0.0, 0.0, height - 0.02}, {half_top.x(), half_top.y(), 0.02}, look);
  for (const double side : {-1.0, 1.0}) {
    furnisher.AddBox({side * (half_top.x() - 0.05), 0.0, 0.5 * height - 0.02},
                     {0.03, half_top.y() - 0.04, 0.5 * height - 0.02},
                     look);
  }
  Stage& stage = furnisher.stage();
  stage.floor_height = height;
  stage.floor = {-0.85 * half_top, 0.85 * half_top};
  stage.footprints.clear();
}

// In the middle of a rectangle around the origin.
Vector3d DrawTarget(Furnisher& furnisher, const Vector2d& half_size, double height) {
  const double x = furnisher.Draw(-0.3, 0.3) * half_size.x();
  return {x, furnisher.Draw(-0.3, 0.3) * half_size.y(), height};
}

Eigen::AlignedBox3d SpaceWithin(const Vector3d& half_size, double margin, double floor_height) {
  const Vector3d lower(margin - half_size.x(), margin - half_size.y(), floor_height);
  return {lower,
          Vector3d(half_size.x() - margin, half_size.y() - margin, 2.0 * half_size.z() - margin)};
}

}  // namespace

void FurnishRoom(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  const Vector3d half_size{
      furnisher.Draw(1.8, 4.5), furnisher.Draw(1.8, 4.5), furnisher.Draw(1.15, 1.8)};
  const Vector2d half_floor = half_size.head<2>();
  AddWalls(furnisher, half_size);
  stage.floor = {-half_floor.array() + 0.4, half_floor.array() - 0.4};
  AddPictures(furnisher, half_size, 2 + furnisher.Index(6));
  AddWallFurniture(furnisher, half_size, 3 + furnisher.Index(7));
  if (furnisher.Chance(0.4)) {
    const Vector2d carpet{furnisher.Draw(0.5, 1.3), furnisher.Draw(0.5, 1.0)};
    AddSheet(furnisher, SurfaceUse::kThing, carpet, 0.008);
  }
  furnisher.ScatterThings(3 + furnisher.Index(7));
  stage.target = DrawTarget(furnisher, half_floor, furnisher.Draw(0.4, 1.2));
  stage.azimuth_deg = furnisher.Draw(0.0, 360.0);
  stage.elevation_deg = furnisher.Draw(0.0, 22.0);
  stage.distance = half_floor.minCoeff() * furnisher.Draw(0.6, 1.1);
  stage.space = SpaceWithin(half_size, 0.25, 0.6);
  stage.min_depth = 0.3;
}

void FurnishTable(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  const Vector3d room{furnisher.Draw(1.8, 3.5), furnisher.Draw(1.8, 3.5), furnisher.Draw(1.2, 1.5)};
  const Vector2d half_top{furnisher.Draw(0.4, 0.9), furnisher.Draw(0.35, 0.7)};
  const double height = furnisher.Draw(0.6, 0.85);
  AddWalls(furnisher, room);
  AddPictures(furnisher, room, furnisher.Index(5));
  AddWallFurniture(furnisher, room, 1 + furnisher.Index(4));
  AddTable(furnisher, half_top, height);
  if (furnisher.Chance(0.4)) {
    const Vector2d sheet{furnisher.Draw(0.1, 0.25), furnisher.Draw(0.08, 0.2)};
    AddSheet(furnisher, SurfaceUse::kPicture, sheet, 0.002);
  }
  furnisher.ScatterThings(4 + furnisher.Index(9));
  stage.target = DrawTarget(furnisher, half_top, height + furnisher.Draw(0.0, 0.1));
  stage.azimuth_deg = furnisher.Draw(0.0, 360.0);
  stage.elevation_deg = furnisher.Draw(14.0, 55.0);
  stage.distance = furnisher.Draw(0.6, 1.3);
  stage.space = SpaceWithin(room, 0.2, height + 0.08);
  stage.min_depth = 0.12;
}

}  // namespace vgtw
