// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_furnisher.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

void AddGroundAndSky(Furnisher& furnisher) {
  const double radius = furnisher.Draw(130.0, 170.0);
  const int sky = furnisher.Look(SurfaceUse::kSky, 50.0);
  const int ground = furnisher.Look(SurfaceUse::kGround, 2.0);
  furnisher.Add(ShapeKind::kDome, Vector3d::Zero(), Vector3d::Constant(radius), sky);
  furnisher.AddBox({0.0, 0.0, -0.5}, {200.0, 200.0, 0.5}, ground);
}

// The street runs along y; `side` is -1 or 1.
struct House {
  double side;
  double x;  // of its front
  double y;
  double half_width;
  double height;
};

void AddHouse(Furnisher& furnisher, const House& house) {
  constexpr double kHalfDepth = 4.0;
  const int facade = furnisher.Look(SurfaceUse::kFacade, 3.0);
  const int roof = furnisher.Look(SurfaceUse::kPaint, 1.0);
  const int door = furnisher.Look(SurfaceUse::kWood, 0.5);
  const double x = house.x + house.side * kHalfDepth;
  const double half_height = 0.5 * house.height;
  furnisher.AddBox({x, house.y, half_height}, {kHalfDepth, house.half_width, half_height}, facade);
  if (furnisher.Chance(0.6)) {
    const Vector3d half_size(kHalfDepth + 0.25, house.half_width + 0.1, 0.2);
    furnisher.AddBox({x, house.y, house.height}, half_size, roof);
  }
  const double door_y = house.y + furnisher.Draw(-0.7, 0.7) * house.half_width;
  furnisher.AddBox({house.x, door_y, 1.05}, {0.05, 0.5, 1.05}, door);
}

void AddHouses(Furnisher& furnisher, double side, double half_street) {
  constexpr double kBegin = -12.0;
  constexpr double kEnd = 30.0;
  for (double y = kBegin; y < kEnd;) {
    House house{.side = side, .x = 0.0, .y = y, .half_width = 0.0, .height = 0.0};
    house.half_width = furnisher.Draw(2.0, 6.0);
    house.height = furnisher.Draw(3.5, 14.0);
    house.x = side * (half_street + furnisher.Draw(0.0, 1.2));
    house.y = y + house.half_width;
    const double gap = furnisher.Chance(0.3) ? furnisher.Draw(0.5, 3.0) : 0.0;
    if (furnisher.Chance(0.88)) AddHouse(furnisher, house);
    y += 2.0 * house.half_width + gap;
  }
}

void AddCarsAndTrees(Furnisher& furnisher, double side, double half_road) {
  constexpr double kEnd = 22.0;
  double y = furnisher.Draw(0.0, 5.0);
  while (y < kEnd) {
    if (furnisher.Chance(0.55)) {
      const Vector3d place(side * (half_road - 1.0), y, 0.0);
      const Body car = furnisher.Make(BodyKind::kCar);
      furnisher.Place(car, {place, side * 0.5 * std::numbers::pi, 1.0});
    }
    if (furnisher.Chance(0.4)) {
      const Vector3d place(side * (half_road + 0.6), y + 3.0, 0.0);
      const Body tree = furnisher.Make(BodyKind::kTree);
      furnisher.Place(tree, {place, 0.0, furnisher.Draw(0.8, 1.4)});
    }
    y += furnisher.Draw(5.0, 11.0);
  }
}

void AddLaneMarks(Furnisher& furnisher) {
  constexpr int kNumMarks = 8;
  const int paint = furnisher.Look(SurfaceUse::kPaint, 1.0);
  for (int i = 0; i < kNumMarks; ++i) {
    furnisher.AddBox({0.0, 4.0 * i - 4.0, 0.0}, {0.08, 1.0, 0.006}, paint);
  }
}

// The front of a house along x at y = 0, in columns and storeys.
struct Front {
  double storey;
  int num_storeys;
  double half_width;
  double height;
  double spacing;
  int num_columns;
  int trim;  // surface

  double ColumnX(double column) const { return (column - 0.5 * (num_columns - 1)) * spacing; }
};

Front DrawFront(Furnisher& furnisher) {
  Front front;
  front.storey = furnisher.Draw(2.6, 3.6);
  front.num_storeys = static_cast<int>(1 + furnisher.Index(4));
  front.half_width = furnisher.Draw(5.0, 12.0);
  front.height = front.storey * front.num_storeys + furnisher.Draw(0.3, 1.5);
  front.spacing = furnisher.Draw(1.6, 3.2);
  front.num_columns = static_cast<int>(2.0 * front.half_width / front.spacing);
  front.trim = furnisher.Look(SurfaceUse::kWall, 1.0);
  return front;
}

struct Window {
  double half_width;
  double half_height;
  int frame;
  int shutter;
  bool has_shutters;
};

void AddWindow(Furnisher& furnisher, const Front& front, const Window& window, double x, double z) {
  const double w = window.half_width;
  const double h = window.half_height;
  const int glass = furnisher.Look(SurfaceUse::kGlass, 1.0);
  furnisher.AddBox({x, 0.0, z}, {w + 0.08, 0.08, h + 0.08}, window.frame);
  furnisher.AddBox({x, 0.0, z}, {w, 0.1, h}, glass);
  furnisher.AddBox({x, 0.0, z - h - 0.1}, {w + 0.15, 0.22, 0.05}, front.trim);
  if (!window.has_shutters) return;
  for (const double side : {-1.0, 1.0}) {
    furnisher.AddBox({x + side * (1.5 * w + 0.1), 0.0, z}, {0.5 * w, 0.06, h}, window.shutter);
  }
}

void AddDoor(Furnisher& furnisher, const Front& front, double x) {
  const int wood = furnisher.Look(SurfaceUse::kWood, 0.6);
  furnisher.AddBox({x, 0.0, 1.1}, {0.55, 0.06, 1.1}, wood);
  furnisher.AddBox({x, -0.3, 0.08}, {0.8, 0.5, 0.08}, front.trim);
}

void AddOpenings(Furnisher& furnisher, const Front& front) {
  constexpr double kReach = 9.0;  // what lies beyond no picture shows
  Window window;
  window.half_width = front.spacing * furnisher.Draw(0.2, 0.34);
  window.half_height = front.storey * furnisher.Draw(0.2, 0.32);
  window.frame = furnisher.Look(SurfaceUse::kPaint, 0.5);
  window.shutter = furnisher.Look(SurfaceUse::kWood, 0.5);
  window.has_shutters = furnisher.Chance(0.4);
  const auto door = static_cast<int>(furnisher.Index(static_cast<size_t>(front.num_columns)));
  for (int row = 0; row < front.num_storeys; ++row) {
    const double z = (row + 0.52) * front.storey;
    for (int column = 0; column < front.num_columns; ++column) {
      const double x = front.ColumnX(column);
      if (std::abs(x) > kReach || z > kReach) continue;
      if (row == 0 && column == door) {
        AddDoor(furnisher, front, x);
      } else {
        AddWindow(furnisher, front, window, x, z);
      }
    }
  }
}

void AddRelief(Furnisher& furnisher, const Front& front) {
  for (int row = 1; row <= front.num_storeys; ++row) {
    if (!furnisher.Chance(0.4)) continue;
    const double depth = furnisher.Draw(0.1, 0.3);
    furnisher.AddBox({0.0, 0.0, row * front.storey}, {front.half_width, depth, 0.1}, front.trim);
  }
  if (!furnisher.Chance(0.5)) return;
  for (int column = 0; column <= front.num_columns; column += 2) {
    furnisher.AddBox({front.ColumnX(column - 0.5), 0.0, 0.5 * front.height},
                     {0.14, 0.18, 0.5 * front.height},
                     front.trim);
  }
}

}  // namespace

void FurnishStreet(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  AddGroundAndSky(furnisher);
  const double half_road = furnisher.Draw(2.2, 4.0);
  const double pavement_width = furnisher.Draw(1.2, 3.0);
  const double half_street = half_road + pavement_width;
  const int pavement = furnisher.Look(SurfaceUse::kGround, 1.0);
  for (const double side : {-1.0, 1.0}) {
    furnisher.AddBox({side * (half_road + 0.5 * pavement_width), 15.0, 0.05},
                     {0.5 * pavement_width, 45.0, 0.07},
                     pavement);
    AddHouses(furnisher, side, half_street);
  }
  if (furnisher.Chance(0.5)) AddLaneMarks(furnisher);
  if (furnisher.Chance(0.6)) {
    const double half_height = furnisher.Draw(2.0, 5.0);
    const double y = furnisher.Draw(22.0, 40.0);
    const int facade = furnisher.Look(SurfaceUse::kFacade, 3.0);
    furnisher.AddBox({0.0, y, half_height}, {14.0, 2.0, half_height}, facade);
  }
  stage.floor = {Vector2d(-half_street + 0.4, 1.5), Vector2d(half_street - 0.4, 16.0)};
  for (const double side : {-1.0, 1.0}) AddCarsAndTrees(furnisher, side, half_road);
  furnisher.ScatterThings(1 + furnisher.Index(6));
  stage.target =
      Vector3d{furnisher.Draw(-1.5, 1.5), furnisher.Draw(6.0, 12.0), furnisher.Draw(0.8, 2.0)};
  stage.azimuth_deg = furnisher.Draw(-125.0, -55.0);
  stage.elevation_deg = furnisher.Draw(1.0, 12.0);
  stage.distance = furnisher.Draw(4.0, 10.0);
  stage.space = {Vector3d(0.4 - half_street, -11.0, 0.8), Vector3d(half_street - 0.4, 20.0, 5.0)};
  stage.min_depth = 0.6;
}

void FurnishFacade(Furnisher& furnisher) {
  Stage& stage = furnisher.stage();
  AddGroundAndSky(furnisher);
  const Front front = DrawFront(furnisher);
  const int wall = furnisher.Look(SurfaceUse::kWall, 2.0);
  const double half_height = 0.5 * front.height;
  furnisher.AddBox({0.0, 3.0, half_height}, {front.half_width, 3.0, half_height}, wall);
  AddOpenings(furnisher, front);
  AddRelief(furnisher, front);
  for (const double side : {-1.0, 1.0}) {
    const double neighbour_half_height = furnisher.Draw(1.5, 5.0);
    const int facade = furnisher.Look(SurfaceUse::kFacade, 3.0);
    furnisher.AddBox({side * (front.half_width + 4.5), 3.5, neighbour_half_height},
                     {4.0, 3.0, neighbour_half_height},
                     facade);
  }
  const double reach = std::min(front.half_width, 6.0);
  stage.floor = {Vector2d(-reach, -4.5), Vector2d(reach, -0.8)};
  furnisher.ScatterThings(2 + furnisher.Index(6));
  const double target_x = furnisher.Draw(-2.0, 2.0);
  stage.target = {target_x, -0.5, furnisher.Draw(1.0, 2.6)};
  stage.azimuth_deg = furnisher.Draw(-130.0, -50.0);
  stage.elevation_deg = furnisher.Draw(0.0, 12.0);
  stage.distance = furnisher.Draw(4.5, 9.0);
  stage.space = {Vector3d(-15.0, -14.0, 0.6), Vector3d(15.0, -1.5, 6.0)};
  stage.min_depth = 0.6;
}

}  // namespace vgtw
