// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_stage.h"

#include "scene/scene_stream.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>

namespace vgtw {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

BodyKind DrawKind(std::initializer_list<BodyKind> kinds, RandomStream& random) {
  return *(kinds.begin() + random.Index(kinds.size()));
}

BodyKind DrawThing(Layout layout, RandomStream& random) {
  using enum BodyKind;
  switch (layout) {
    case Layout::kRoom:
      return DrawKind({kChair, kPlant, kParcel, kBall, kStack, kBin, kFloorLamp, kTable}, random);
    case Layout::kTable:
      return DrawKind({kBottle, kParcel, kBall, kStack, kPlant, kBin}, random);
    case Layout::kStreet:
    case Layout::kFacade:
      break;
  }
  return DrawKind({kBin, kParcel, kPlant, kBench, kStack, kTree, kTable, kChair}, random);
}

// Of a kind's natural size.
double DrawSize(BodyKind kind, Layout layout, RandomStream& random) {
  const double variation = random.Uniform(0.8, 1.25);
  if (layout == Layout::kTable) {
    switch (kind) {
      case BodyKind::kPerson:
        return 0.14 * variation;
      case BodyKind::kCar:
        return 0.06 * variation;
      default:
        return 0.32 * variation;
    }
  }
  if (layout == Layout::kRoom && kind == BodyKind::kCar) return 0.3 * variation;
  return variation;
}

class Furnisher {
 public:
  Furnisher(const std::vector<PhotoTexture>& photos, RandomStream& random, Stage& stage)
      : photos_(photos), random_(random), stage_(stage) {}

  int Look(SurfaceUse use, double size) {
    stage_.surfaces.push_back(MakeSurface(use, size, photos_, random_));
    return static_cast<int>(stage_.surfaces.size()) - 1;
  }

  Solid& Add(ShapeKind kind, const Vector3d& centre, const Vector3d& half_size, int surface) {
    stage_.pieces.push_back({{kind, Eigen::Matrix3d::Identity(), centre, half_size}, surface});
    return stage_.pieces.back().solid;
  }
  Solid& AddBox(const Vector3d& centre, const Vector3d& half_size, int surface) {
    return Add(ShapeKind::kBox, centre, half_size, surface);
  }

  void Place(const Body& body, const Stand& stand) {
    const std::vector<Piece> pieces = PlaceBody(body, stand);
    stage_.pieces.insert(stage_.pieces.end(), pieces.begin(), pieces.end());
    stage_.footprints.push_back({stand.place.head<2>(), stand.size * body.radius});
  }

  // Where `draw_place` finds a free place after some tries; else the body is left out.
  template <typename DrawPlace>
  void PlaceFree(const Body& body, double size, const DrawPlace& draw_place) {
    constexpr int kMaxTries = 12;
    for (int i = 0; i < kMaxTries; ++i) {
      const Vector2d place = draw_place();
      if (!stage_.IsFree(place, size * body.radius)) continue;
      Place(body, {{place.x(), place.y(), stage_.floor_height}, Draw(0.0, 2.0 * kPi), size});
      return;
    }
  }

  void Scatter(const Body& body, double size) {
    PlaceFree(body, size, [this] { return PlaceOnFloor(); });
  }
  void ScatterThings(size_t num_things) {
    for (size_t i = 0; i < num_things; ++i) {
      const BodyKind kind = DrawThing(stage_.layout, random_);
      const Body body = Make(kind);
      Scatter(body, DrawSize(kind, stage_.layout, random_));
    }
  }

  Vector2d PlaceOnFloor() {
    const double x = Draw(stage_.floor.min().x(), stage_.floor.max().x());
    return {x, Draw(stage_.floor.min().y(), stage_.floor.max().y())};
  }

  Body Make(BodyKind kind) { return MakeBody(kind, photos_, random_, stage_.surfaces); }
  double Draw(double min, double max) { return random_.Uniform(min, max); }
  bool Chance(double probability) { return random_.Chance(probability); }
  size_t Index(size_t n) { return random_.Index(n); }
  Stage& stage() { return stage_; }
  RandomStream& random() { return random_; }

 private:
  const std::vector<PhotoTexture>& photos_;
  RandomStream& random_;
  Stage& stage_;
};

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
  furnisher.Add(ShapeKind::kRoom, {0.0, 0.0, z}, half_size.array() + 2.0 * kThickness, ceiling);
  furnisher.AddBox({0.0, 0.0, -kThickness}, {x, y, kThickness}, floor);
  furnisher.AddBox({0.0, 0.0, 2.0 * z + kThickness}, {x, y, kThickness}, ceiling);
  for (const double side : {-1.0, 1.0}) {
    furnisher.AddBox({side * (x + kThickness), 0.0, z}, {kThickness, y, z}, wall);
    furnisher.AddBox(
        {0.0, side * (y + kThickness), z}, {x, kThickness, z}, side > 0.0 ? other_wall : wall);
  }
}

// A place on a wall of a room around the origin; yaw turns x into the room.
struct WallPlace {
  Vector2d place;
  Vector2d along;
  double yaw_rad;
};

WallPlace DrawWallPlace(Furnisher& furnisher, const Vector3d& half_size, double margin) {
  const size_t side = furnisher.Index(4);
  const double yaw_rad = 0.5 * kPi * static_cast<double>(side);
  const Vector2d inwards(std::cos(yaw_rad), std::sin(yaw_rad));
  const Vector2d along(-inwards.y(), inwards.x());
  const bool is_x = side % 2 == 0;
  const double to_wall = is_x ? half_size.x() : half_size.y();
  const double reach = std::max(0.0, (is_x ? half_size.y() : half_size.x()) - margin);
  return {-to_wall * inwards + furnisher.Draw(-reach, reach) * along, along, yaw_rad};
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
  for (size_t i = 0; i < num_bodies; ++i) {
    const Body body = furnisher.Make(
        DrawKind({kShelf, kShelf, kCupboard, kCupboard, kSofa, kPlant, kFloorLamp, kTable},
                 furnisher.random()));
    const WallPlace wall = DrawWallPlace(furnisher, half_size, 0.8);
    const Vector2d inwards(std::cos(wall.yaw_rad), std::sin(wall.yaw_rad));
    const Vector2d place = wall.place + std::min(0.45, 0.8 * body.radius) * inwards;
    if (!furnisher.stage().IsFree(place, 0.8 * body.radius)) continue;
    furnisher.Place(body, {{place.x(), place.y(), 0.0}, wall.yaw_rad, 1.0});
  }
}

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
    const Vector2d place = 0.3 * furnisher.PlaceOnFloor();
    furnisher.AddBox({place.x(), place.y(), 0.0},
                     {furnisher.Draw(0.5, 1.3), furnisher.Draw(0.5, 1.0), 0.008},
                     furnisher.Look(SurfaceUse::kThing, 1.0));
  }
  furnisher.ScatterThings(3 + furnisher.Index(7));
  const double smaller = half_floor.minCoeff();
  stage.target = {0.3 * half_size.x() * furnisher.Draw(-1.0, 1.0),
                  0.3 * half_size.y() * furnisher.Draw(-1.0, 1.0),
                  furnisher.Draw(0.4, 1.2)};
  stage.azimuth_deg = furnisher.Draw(0.0, 360.0);
  stage.elevation_deg = furnisher.Draw(0.0, 22.0);
  stage.distance = smaller * furnisher.Draw(0.6, 1.1);
  const Vector3d margin(0.25, 0.25, 0.4);
  stage.space = {Vector3d(-half_size.x(), -half_size.y(), 0.2) + margin,
                 Vector3d(half_size.x(), half_size.y(), 2.0 * half_size.z()) - margin};
  stage.min_depth = 0.3;
}

void FurnishTable(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  const Vector3d room{furnisher.Draw(1.8, 3.5), furnisher.Draw(1.8, 3.5), furnisher.Draw(1.2, 1.5)};
  const Vector2d half_top(furnisher.Draw(0.4, 0.9), furnisher.Draw(0.35, 0.7));
  const double height = furnisher.Draw(0.6, 0.85);
  AddWalls(furnisher, room);
  AddPictures(furnisher, room, furnisher.Index(5));
  AddWallFurniture(furnisher, room, 1 + furnisher.Index(4));
  const int wood =
      furnisher.Look(furnisher.Chance(0.7) ? SurfaceUse::kWood : SurfaceUse::kThing, 0.6);
  furnisher.AddBox({0.0, 0.0, height - 0.02}, {half_top.x(), half_top.y(), 0.02}, wood);
  for (const double side : {-1.0, 1.0}) {
    furnisher.AddBox({side * (half_top.x() - 0.05), 0.0, 0.5 * height - 0.02},
                     {0.03, half_top.y() - 0.04, 0.5 * height - 0.02},
                     wood);
  }
  stage.floor_height = height;
  stage.floor = {-0.85 * half_top, 0.85 * half_top};
  stage.footprints.clear();
  if (furnisher.Chance(0.4)) {
    const Vector2d place = 0.4 * furnisher.PlaceOnFloor();
    furnisher.AddBox({place.x(), place.y(), height},
                     {furnisher.Draw(0.1, 0.25), furnisher.Draw(0.08, 0.2), 0.002},
                     furnisher.Look(SurfaceUse::kPicture, 0.25));
  }
  furnisher.ScatterThings(4 + furnisher.Index(9));
  stage.target = {0.3 * half_top.x() * furnisher.Draw(-1.0, 1.0),
                  0.3 * half_top.y() * furnisher.Draw(-1.0, 1.0),
                  height + furnisher.Draw(0.0, 0.1)};
  stage.azimuth_deg = furnisher.Draw(0.0, 360.0);
  stage.elevation_deg = furnisher.Draw(14.0, 55.0);
  stage.distance = furnisher.Draw(0.6, 1.3);
  stage.space = {Vector3d(0.2 - room.x(), 0.2 - room.y(), height + 0.08),
                 Vector3d(room.x() - 0.2, room.y() - 0.2, 2.0 * room.z() - 0.2)};
  stage.min_depth = 0.12;
}

void AddGroundAndSky(Furnisher& furnisher) {
  const double radius = furnisher.Draw(70.0, 90.0);
  furnisher.Add(ShapeKind::kDome,
                Vector3d::Zero(),
                Vector3d::Constant(radius),
                furnisher.Look(SurfaceUse::kSky, 50.0));
  furnisher.AddBox({0.0, 0.0, -0.5}, {100.0, 100.0, 0.5}, furnisher.Look(SurfaceUse::kGround, 2.0));
}

void AddHouses(Furnisher& furnisher, double side, double half_street, double begin, double end) {
  for (double y = begin; y < end;) {
    const double half_width = furnisher.Draw(2.0, 6.0);
    const double height = furnisher.Draw(3.5, 14.0);
    const double setback = furnisher.Draw(0.0, 1.2);
    if (furnisher.Chance(0.88)) {
      const int facade = furnisher.Look(SurfaceUse::kFacade, 3.0);
      const double x = side * (half_street + setback + 4.0);
      furnisher.AddBox({x, y + half_width, 0.5 * height}, {4.0, half_width, 0.5 * height}, facade);
      if (furnisher.Chance(0.6)) {
        furnisher.AddBox({x, y + half_width, height},
                         {4.25, half_width + 0.1, 0.2},
                         furnisher.Look(SurfaceUse::kPaint, 1.0));
      }
      furnisher.AddBox({x - side * 4.0, y + half_width * furnisher.Draw(0.3, 1.7), 1.05},
                       {0.05, 0.5, 1.05},
                       furnisher.Look(SurfaceUse::kWood, 0.5));
    }
    y += 2.0 * half_width + (furnisher.Chance(0.3) ? furnisher.Draw(0.5, 3.0) : 0.0);
  }
}

void FurnishStreet(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  AddGroundAndSky(furnisher);
  const double half_road = furnisher.Draw(2.2, 4.0);
  const double half_street = half_road + furnisher.Draw(1.2, 3.0);
  const int pavement = furnisher.Look(SurfaceUse::kGround, 1.0);
  for (const double side : {-1.0, 1.0}) {
    furnisher.AddBox({side * 0.5 * (half_road + half_street), 15.0, 0.05},
                     {0.5 * (half_street - half_road), 45.0, 0.07},
                     pavement);
    AddHouses(furnisher, side, half_street, -12.0, 35.0);
  }
  if (furnisher.Chance(0.5)) {
    const int paint = furnisher.Look(SurfaceUse::kPaint, 1.0);
    for (int i = 0; i < 8; ++i)
      furnisher.AddBox({0.0, 4.0 * i - 4.0, 0.0}, {0.08, 1.0, 0.006}, paint);
  }
  if (furnisher.Chance(0.6)) {
    const double height = furnisher.Draw(4.0, 9.0);
    furnisher.AddBox({0.0, furnisher.Draw(22.0, 40.0), height},
                     {14.0, 2.0, height},
                     furnisher.Look(SurfaceUse::kFacade, 3.0));
  }
  stage.floor = {Vector2d(-half_street + 0.4, 1.5), Vector2d(half_street - 0.4, 16.0)};
  for (const double side : {-1.0, 1.0}) {
    const double offset = side * (half_road - 1.0);
    for (double y = furnisher.Draw(0.0, 5.0); y < 22.0; y += furnisher.Draw(5.0, 11.0)) {
      if (furnisher.Chance(0.55)) {
        furnisher.Place(furnisher.Make(BodyKind::kCar), {{offset, y, 0.0}, side * 0.5 * kPi, 1.0});
      }
      if (furnisher.Chance(0.4)) {
        furnisher.Place(furnisher.Make(BodyKind::kTree),
                        {{side * (half_road + 0.6), y + 3.0, 0.0}, 0.0, furnisher.Draw(0.8, 1.4)});
      }
    }
  }
  furnisher.ScatterThings(1 + furnisher.Index(6));
  stage.target = {furnisher.Draw(-1.5, 1.5), furnisher.Draw(6.0, 12.0), furnisher.Draw(0.8, 2.0)};
  stage.azimuth_deg = -90.0 + furnisher.Draw(-35.0, 35.0);
  stage.elevation_deg = furnisher.Draw(1.0, 12.0);
  stage.distance = furnisher.Draw(4.0, 10.0);
  stage.space = {Vector3d(0.4 - half_street, -11.0, 0.8), Vector3d(half_street - 0.4, 20.0, 5.0)};
  stage.min_depth = 0.6;
}

void FurnishFacade(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  AddGroundAndSky(furnisher);
  const double storey = furnisher.Draw(2.6, 3.6);
  const auto num_storeys = static_cast<int>(1 + furnisher.Index(4));
  const double half_width = furnisher.Draw(5.0, 12.0);
  const double height = storey * num_storeys + furnisher.Draw(0.3, 1.5);
  furnisher.AddBox({0.0, 3.0, 0.5 * height},
                   {half_width, 3.0, 0.5 * height},
                   furnisher.Look(SurfaceUse::kWall, 2.0));
  const double spacing = furnisher.Draw(1.6, 3.2);
  const double pane_half_width = spacing * furnisher.Draw(0.2, 0.34);
  const double pane_half_height = storey * furnisher.Draw(0.2, 0.32);
  const int frame = furnisher.Look(SurfaceUse::kPaint, 0.5);
  const int sill = furnisher.Look(SurfaceUse::kWall, 1.0);
  const bool has_shutters = furnisher.Chance(0.4);
  const int shutter = furnisher.Look(SurfaceUse::kWood, 0.5);
  const auto num_columns = static_cast<int>(2.0 * half_width / spacing);
  const double door = std::floor(furnisher.Draw(0.0, num_columns));
  for (int row = 0; row < num_storeys; ++row) {
    for (int column = 0; column < num_columns; ++column) {
      const double x = (column - 0.5 * (num_columns - 1)) * spacing;
      const double z = (row + 0.52) * storey;
      if (std::abs(x) > 9.0 || z > 9.0) continue;  // beyond every picture
      if (row == 0 && column == door) {
        furnisher.AddBox({x, 0.0, 1.1}, {0.55, 0.06, 1.1}, furnisher.Look(SurfaceUse::kWood, 0.6));
        furnisher.AddBox({x, -0.3, 0.08}, {0.8, 0.5, 0.08}, sill);
        continue;
      }
      furnisher.AddBox({x, 0.0, z}, {pane_half_width + 0.08, 0.08, pane_half_height + 0.08}, frame);
      furnisher.AddBox({x, 0.0, z},
                       {pane_half_width, 0.1, pane_half_height},
                       furnisher.Look(SurfaceUse::kGlass, 1.0));
      furnisher.AddBox(
          {x, 0.0, z - pane_half_height - 0.1}, {pane_half_width + 0.15, 0.22, 0.05}, sill);
      if (!has_shutters) continue;
      for (const double side : {-1.0, 1.0}) {
        furnisher.AddBox({x + side * (1.5 * pane_half_width + 0.1), 0.0, z},
                         {0.5 * pane_half_width, 0.06, pane_half_height},
                         shutter);
      }
    }
    if (furnisher.Chance(0.4)) {
      furnisher.AddBox(
          {0.0, 0.0, (row + 1) * storey}, {half_width, furnisher.Draw(0.1, 0.3), 0.1}, sill);
    }
  }
  if (furnisher.Chance(0.5)) {
    for (int i = 0; i <= num_columns; i += 2) {
      const double x = (i - 0.5 * num_columns) * spacing;
      furnisher.AddBox({x, 0.0, 0.5 * height}, {0.14, 0.18, 0.5 * height}, sill);
    }
  }
  for (const double side : {-1.0, 1.0}) {
    const double other_height = furnisher.Draw(3.0, 10.0);
    furnisher.AddBox({side * (half_width + 4.5), 3.5, 0.5 * other_height},
                     {4.0, 3.0, 0.5 * other_height},
                     furnisher.Look(SurfaceUse::kFacade, 3.0));
  }
  const double reach = std::min(half_width, 6.0);
  stage.floor = {Vector2d(-reach, -4.5), Vector2d(reach, -0.8)};
  furnisher.ScatterThings(2 + furnisher.Index(6));
  stage.target = {furnisher.Draw(-2.0, 2.0), -0.5, furnisher.Draw(1.0, 2.6)};
  stage.azimuth_deg = -90.0 + furnisher.Draw(-40.0, 40.0);
  stage.elevation_deg = furnisher.Draw(0.0, 12.0);
  stage.distance = furnisher.Draw(4.5, 9.0);
  stage.space = {Vector3d(-15.0, -14.0, 0.6), Vector3d(15.0, -1.5, 6.0)};
  stage.min_depth = 0.6;
}

}  // namespace

bool Stage::IsFree(const Vector2d& place, double radius) const {
  return std::none_of(footprints.begin(), footprints.end(), [&](const Footprint& other) {
    return (other.centre - place).norm() < 0.85 * (other.radius + radius);
  });
}

std::vector<CastMember> DrawCast(uint32_t kinds,
                                 const std::vector<PhotoTexture>& photos,
                                 RandomStream& random,
                                 Stage& stage) {
  constexpr size_t kCastSize = 5;
  const bool is_street = stage.layout == Layout::kStreet;
  std::vector<DistractorKind> bodies;
  for (const auto& [kind, weight] : {std::pair{kPersonDistractors, 2},
                                     std::pair{kCarDistractors, is_street ? 2 : 1},
                                     std::pair{kThingDistractors, 2}}) {
    if ((kinds & kind) != 0) bodies.insert(bodies.end(), static_cast<size_t>(weight), kind);
  }
  std::vector<CastMember> cast;
  while (cast.size() < kCastSize) {
    const DistractorKind drawn = bodies[random.Index(bodies.size())];
    const BodyKind kind = drawn == kPersonDistractors ? BodyKind::kPerson
                          : drawn == kCarDistractors  ? BodyKind::kCar
                                                      : DrawThing(stage.layout, random);
    const double size = DrawSize(kind, stage.layout, random);
    cast.push_back({MakeBody(kind, photos, random, stage.surfaces), size});
  }
  return cast;
}

void FurnishStage(const std::vector<CastMember>& look_alikes,
                  const std::vector<PhotoTexture>& photos,
                  RandomStream& random,
                  Stage& stage) {
  Furnisher furnisher(photos, random, stage);
  switch (stage.layout) {
    case Layout::kRoom:
      FurnishRoom(furnisher);
      break;
    case Layout::kTable:
      FurnishTable(furnisher);
      break;
    case Layout::kStreet:
      FurnishStreet(furnisher);
      break;
    case Layout::kFacade:
      FurnishFacade(furnisher);
      break;
  }
  for (const CastMember& member : look_alikes) furnisher.Scatter(member.body, member.size);
}

}  // namespace vgtw
