// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_bodies.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

constexpr double kPi = std::numbers::pi;

// Adds pieces to a body, each with one of its surfaces.
class Builder {
 public:
  Builder(const std::vector<PhotoTexture>& photos,
          RandomStream& random,
          std::vector<Surface>& surfaces)
      : random_(random), photos_(photos), surfaces_(surfaces) {}

  int Look(SurfaceUse use, double size) {
    surfaces_.push_back(MakeSurface(use, size, photos_, random_));
    return static_cast<int>(surfaces_.size()) - 1;
  }

  Solid& Add(ShapeKind kind,
             const Eigen::Vector3d& centre,
             const Eigen::Vector3d& half_size,
             int surface) {
    body_.pieces.push_back({{kind, Eigen::Matrix3d::Identity(), centre, half_size}, surface});
    return body_.pieces.back().solid;
  }
  Solid& AddBox(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_size, int surface) {
    return Add(ShapeKind::kBox, centre, half_size, surface);
  }
  Solid& AddBall(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_size, int surface) {
    return Add(ShapeKind::kEllipsoid, centre, half_size, surface);
  }
  // Upright; `foot` is the middle of its lower cap.
  Solid& AddColumn(const Eigen::Vector3d& foot, double radius, double height, int surface) {
    const Eigen::Vector3d centre = foot + 0.5 * height * Eigen::Vector3d::UnitZ();
    return Add(ShapeKind::kCylinder, centre, {radius, radius, 0.5 * height}, surface);
  }
  // Four legs at the corners of a rectangle.
  void AddLegs(const Eigen::Vector2d& half_size, double thickness, double height, int surface) {
    for (const double x : {-1.0, 1.0}) {
      for (const double y : {-1.0, 1.0}) {
        AddBox({x * (half_size.x() - thickness), y * (half_size.y() - thickness), 0.5 * height},
               {thickness, thickness, 0.5 * height},
               surface);
      }
    }
  }

  double Draw(double min, double max) { return random_.Uniform(min, max); }
  bool Chance(double probability) { return random_.Chance(probability); }
  size_t Index(size_t n) { return random_.Index(n); }

  Body Finish(BodyKind kind) {
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

 private:
  RandomStream& random_;
  const std::vector<PhotoTexture>& photos_;
  std::vector<Surface>& surfaces_;
  Body body_;
};

void Turn(Solid& solid, double angle_rad, const Eigen::Vector3d& axis) {
  solid.local_from_world_rotation =
      Eigen::AngleAxisd(-angle_rad, axis).toRotationMatrix() * solid.local_from_world_rotation;
}

void MakePerson(Builder& builder) {
  const double height = builder.Draw(0.85, 1.1);
  const double width = builder.Draw(0.85, 1.3);
  const double step = builder.Draw(-0.9, 0.9);
  const int skin = builder.Look(SurfaceUse::kSkin, 0.2);
  const int shirt = builder.Look(SurfaceUse::kCloth, 0.5);
  const int trousers = builder.Look(SurfaceUse::kCloth, 0.5);
  const int hair = builder.Look(SurfaceUse::kRubber, 0.2);
  builder.AddBall({0.0, 0.0, 1.60 * height}, {0.11, 0.09, 0.14}, skin);
  builder.AddBall({-0.025, 0.0, 1.655 * height}, {0.11, 0.10, 0.11}, hair);
  builder.AddBall({0.0, 0.0, 1.18 * height}, {0.14 * width, 0.21 * width, 0.34}, shirt);
  for (const double side : {-1.0, 1.0}) {
    Solid& leg = builder.AddBall(
        {side * 0.15 * step, side * 0.10, 0.46 * height}, {0.09, 0.09 * width, 0.48}, trousers);
    Turn(leg, -side * 0.3 * step, Eigen::Vector3d::UnitY());
    Solid& arm = builder.AddBall(
        {-side * 0.12 * step, side * 0.24 * width, 1.12 * height}, {0.055, 0.055, 0.32}, shirt);
    Turn(arm, side * 0.5 * step, Eigen::Vector3d::UnitY());
  }
  if (builder.Chance(0.3)) {
    builder.AddBox({0.0, 0.34 * width, 0.65 * height},
                   {0.18, 0.06, 0.16},
                   builder.Look(SurfaceUse::kThing, 0.3));
  }
  if (builder.Chance(0.25)) {
    builder.AddBox({-0.20 * width, 0.0, 1.25 * height},
                   {0.09, 0.15, 0.22},
                   builder.Look(SurfaceUse::kThing, 0.3));
  }
}

void MakeCar(Builder& builder) {
  const int paint = builder.Look(SurfaceUse::kPaint, 2.0);
  const int glass = builder.Look(SurfaceUse::kGlass, 1.0);
  const int rubber = builder.Look(SurfaceUse::kRubber, 0.5);
  const bool is_van = builder.Chance(0.3);
  const double length = builder.Draw(1.7, 2.3);
  const double body_half_height = is_van ? 0.42 : 0.3;
  const double deck = 0.3 + 2.0 * body_half_height;
  builder.AddBox({0.0, 0.0, 0.3 + body_half_height}, {length, 0.85, body_half_height}, paint);
  const double cabin_half_height = is_van ? 0.42 : 0.26;
  const double cabin_length = (is_van ? 0.85 : 0.55) * length;
  const double cabin_x = is_van ? -0.1 * length : -0.1;
  builder.AddBox({cabin_x, 0.0, deck + cabin_half_height},
                 {cabin_length, 0.76, cabin_half_height},
                 is_van ? paint : glass);
  builder.AddBox(
      {cabin_x, 0.0, deck + 2.0 * cabin_half_height}, {0.95 * cabin_length, 0.78, 0.04}, paint);
  const int lamp = builder.Look(SurfaceUse::kPaint, 0.2);
  for (const double side : {-1.0, 1.0}) {
    builder.AddBox({length, side * 0.62, 0.62}, {0.03, 0.14, 0.08}, lamp);
    for (const double end : {-0.62, 0.62}) {
      Solid& wheel = builder.Add(
          ShapeKind::kCylinder, {end * length, side * 0.78, 0.33}, {0.33, 0.33, 0.11}, rubber);
      Turn(wheel, 0.5 * kPi, Eigen::Vector3d::UnitX());
    }
  }
}

void MakeTable(Builder& builder) {
  const Eigen::Vector2d half_size(builder.Draw(0.4, 0.9), builder.Draw(0.35, 0.6));
  const double height = builder.Draw(0.45, 0.8);
  const int wood = builder.Look(SurfaceUse::kWood, 0.8);
  builder.AddBox({0.0, 0.0, height}, {half_size.x(), half_size.y(), 0.025}, wood);
  if (builder.Chance(0.3)) {
    builder.AddColumn(Eigen::Vector3d::Zero(), 0.06, height, wood);
  } else {
    builder.AddLegs(half_size,
                    0.03,
                    height,
                    builder.Chance(0.5) ? wood : builder.Look(SurfaceUse::kPaint, 0.5));
  }
  const size_t num_things = builder.Index(4);
  for (size_t i = 0; i < num_things; ++i) {
    const double size = builder.Draw(0.05, 0.14);
    const Eigen::Vector3d place(builder.Draw(-0.8, 0.8) * half_size.x(),
                                builder.Draw(-0.8, 0.8) * half_size.y(),
                                height + 0.025);
    const int look = builder.Look(SurfaceUse::kThing, 2.0 * size);
    if (builder.Chance(0.5)) {
      builder.AddColumn(place, 0.6 * size, 2.0 * size, look);
    } else {
      builder.AddBox(place + Eigen::Vector3d(0.0, 0.0, size), {1.4 * size, size, size}, look);
    }
  }
}

void MakeChair(Builder& builder) {
  const double seat_height = builder.Draw(0.42, 0.5);
  const double half_width = builder.Draw(0.2, 0.27);
  const int wood = builder.Look(SurfaceUse::kWood, 0.5);
  const int seat = builder.Chance(0.5) ? wood : builder.Look(SurfaceUse::kCloth, 0.4);
  builder.AddBox({0.0, 0.0, seat_height}, {half_width, half_width, 0.03}, seat);
  const double back_half_height = builder.Draw(0.18, 0.3);
  Solid& back = builder.AddBox({-half_width, 0.0, seat_height + 0.1 + back_half_height},
                               {0.02, half_width, back_half_height},
                               seat);
  Turn(back, builder.Draw(-0.2, 0.0), Eigen::Vector3d::UnitY());
  builder.AddLegs({half_width, half_width}, 0.022, seat_height, wood);
}

void MakeSofa(Builder& builder) {
  const double half_length = builder.Draw(0.5, 1.1);
  const int cloth = builder.Look(SurfaceUse::kCloth, 1.0);
  const int cushion = builder.Look(SurfaceUse::kThing, 0.4);
  builder.AddBox({0.0, 0.0, 0.2}, {0.42, half_length, 0.2}, cloth);
  builder.AddBox({-0.34, 0.0, 0.6}, {0.1, half_length, 0.25}, cloth);
  for (const double side : {-1.0, 1.0}) {
    builder.AddBox({0.0, side * (half_length + 0.08), 0.3}, {0.42, 0.09, 0.3}, cloth);
  }
  Solid& pillow = builder.AddBall(
      {-0.15, builder.Draw(-0.7, 0.7) * half_length, 0.56}, {0.1, 0.22, 0.2}, cushion);
  Turn(pillow, -0.3, Eigen::Vector3d::UnitY());
}

void MakeShelf(Builder& builder) {
  const double half_width = builder.Draw(0.35, 0.7);
  const double height = builder.Draw(0.9, 2.1);
  const double depth = 0.16;
  const int wood = builder.Look(SurfaceUse::kWood, 0.6);
  builder.AddBox({-depth, 0.0, 0.5 * height}, {0.015, half_width, 0.5 * height}, wood);
  for (const double side : {-1.0, 1.0}) {
    builder.AddBox({0.0, side * half_width, 0.5 * height}, {depth, 0.02, 0.5 * height}, wood);
  }
  const int num_boards = static_cast<int>(height / 0.4) + 1;
  for (int board = 0; board < num_boards; ++board) {
    const double z = height * board / (num_boards - 1);
    builder.AddBox({0.0, 0.0, z}, {depth, half_width, 0.015}, wood);
    if (board == num_boards - 1) break;
    const double end = builder.Draw(-0.3, 0.95) * half_width;
    for (double y = -0.93 * half_width; y < end;) {
      const double half_thickness = builder.Draw(0.04, 0.11);
      const double half_height = builder.Draw(0.09, 0.16);
      y += half_thickness;
      builder.AddBox({builder.Draw(-0.04, 0.02), y, z + half_height},
                     {0.11, half_thickness, half_height},
                     builder.Look(SurfaceUse::kThing, 0.2));
      y += half_thickness;
    }
  }
}

void MakeCupboard(Builder& builder) {
  const Eigen::Vector3d half_size(
      builder.Draw(0.2, 0.35), builder.Draw(0.3, 0.8), builder.Draw(0.35, 1.1));
  const int wood = builder.Look(SurfaceUse::kWood, 0.8);
  const int front = builder.Look(SurfaceUse::kWood, 0.6);
  const int knob = builder.Look(SurfaceUse::kRubber, 0.1);
  builder.AddBox({0.0, 0.0, half_size.z()}, half_size, wood);
  const size_t num_columns = 1 + builder.Index(3);
  const size_t num_rows = 1 + builder.Index(3);
  const double door_width = half_size.y() / static_cast<double>(num_columns);
  const double door_height = half_size.z() / static_cast<double>(num_rows);
  for (size_t column = 0; column < num_columns; ++column) {
    for (size_t row = 0; row < num_rows; ++row) {
      const double y = (2.0 * static_cast<double>(column) + 1.0) * door_width - half_size.y();
      const double z = (2.0 * static_cast<double>(row) + 1.0) * door_height;
      builder.AddBox({half_size.x(), y, z}, {0.02, 0.9 * door_width, 0.9 * door_height}, front);
      builder.AddBall(
          {half_size.x() + 0.035, y + 0.6 * door_width, z}, {0.025, 0.025, 0.025}, knob);
    }
  }
}

void MakeFloorLamp(Builder& builder) {
  const double height = builder.Draw(1.2, 1.8);
  const int metal = builder.Look(SurfaceUse::kPaint, 0.5);
  builder.AddColumn(Eigen::Vector3d::Zero(), 0.16, 0.03, metal);
  builder.AddColumn(Eigen::Vector3d::Zero(), 0.018, height, metal);
  const int shade = builder.Look(SurfaceUse::kCloth, 0.3);
  if (builder.Chance(0.5)) {
    builder.AddColumn({0.0, 0.0, height - 0.1}, 0.19, 0.28, shade);
  } else {
    builder.AddBall({0.0, 0.0, height + 0.1}, {0.17, 0.17, 0.17}, shade);
  }
}

void AddCrown(Builder& builder, double radius, double height, size_t num_balls) {
  for (size_t i = 0; i < num_balls; ++i) {
    const double size = radius * builder.Draw(0.45, 0.8);
    const Eigen::Vector3d offset(builder.Draw(-0.6, 0.6) * radius,
                                 builder.Draw(-0.6, 0.6) * radius,
                                 builder.Draw(-0.5, 0.6) * radius);
    builder.AddBall(Eigen::Vector3d(0.0, 0.0, height) + offset,
                    {size, size, size * builder.Draw(0.7, 1.1)},
                    builder.Look(SurfaceUse::kFoliage, 0.6 * radius));
  }
}

void MakePlant(Builder& builder) {
  const double pot_height = builder.Draw(0.2, 0.4);
  builder.AddColumn(Eigen::Vector3d::Zero(),
                    builder.Draw(0.12, 0.22),
                    pot_height,
                    builder.Look(SurfaceUse::kThing, 0.3));
  AddCrown(
      builder, builder.Draw(0.2, 0.38), pot_height + builder.Draw(0.2, 0.5), 3 + builder.Index(3));
}

void MakeTree(Builder& builder) {
  const double trunk_height = builder.Draw(1.6, 2.8);
  const double radius = builder.Draw(0.9, 1.6);
  builder.AddColumn(Eigen::Vector3d::Zero(),
                    builder.Draw(0.1, 0.2),
                    trunk_height + 0.6,
                    builder.Look(SurfaceUse::kWood, 0.4));
  AddCrown(builder, radius, trunk_height + 0.6 * radius, 4 + builder.Index(3));
}

void MakeBin(Builder& builder) {
  const double radius = builder.Draw(0.15, 0.3);
  const double height = builder.Draw(0.4, 0.9);
  const int paint = builder.Look(SurfaceUse::kThing, 0.5);
  builder.AddColumn(Eigen::Vector3d::Zero(), radius, height, paint);
  builder.AddColumn({0.0, 0.0, height}, 1.08 * radius, 0.06, builder.Look(SurfaceUse::kPaint, 0.3));
}

void MakeParcel(Builder& builder) {
  const Eigen::Vector3d half_size(
      builder.Draw(0.15, 0.4), builder.Draw(0.15, 0.4), builder.Draw(0.12, 0.4));
  builder.AddBox(
      {0.0, 0.0, half_size.z()}, half_size, builder.Look(SurfaceUse::kThing, 2.0 * half_size.x()));
}

void MakeBallBody(Builder& builder) {
  const double radius = builder.Draw(0.12, 0.35);
  builder.AddBall(
      {0.0, 0.0, radius}, {radius, radius, radius}, builder.Look(SurfaceUse::kThing, radius));
}

void MakeStack(Builder& builder) {
  const size_t num_boxes = 2 + builder.Index(4);
  Eigen::Vector2d half_size(builder.Draw(0.2, 0.4), builder.Draw(0.15, 0.35));
  double z = 0.0;
  for (size_t i = 0; i < num_boxes; ++i) {
    const double half_height = builder.Draw(0.03, 0.16);
    Solid& box =
        builder.AddBox({builder.Draw(-0.04, 0.04), builder.Draw(-0.04, 0.04), z + half_height},
                       {half_size.x(), half_size.y(), half_height},
                       builder.Look(SurfaceUse::kThing, half_size.x()));
    Turn(box, builder.Draw(-0.4, 0.4), Eigen::Vector3d::UnitZ());
    z += 2.0 * half_height;
    half_size *= builder.Draw(0.8, 1.0);
  }
}

void MakeBottle(Builder& builder) {
  const double radius = builder.Draw(0.1, 0.2);
  const double height = builder.Draw(0.3, 0.6);
  const int look = builder.Look(SurfaceUse::kThing, 2.0 * radius);
  builder.AddColumn(Eigen::Vector3d::Zero(), radius, height, look);
  builder.AddBall({0.0, 0.0, height}, {radius, radius, 0.6 * radius}, look);
  builder.AddColumn({0.0, 0.0, height},
                    0.35 * radius,
                    builder.Draw(0.15, 0.3),
                    builder.Look(SurfaceUse::kPaint, radius));
}

void MakeBench(Builder& builder) {
  const double half_length = builder.Draw(0.6, 1.0);
  const int wood = builder.Look(SurfaceUse::kWood, 0.8);
  const int metal = builder.Look(SurfaceUse::kRubber, 0.4);
  for (const double x : {-0.14, 0.0, 0.14}) {
    builder.AddBox({x, 0.0, 0.45}, {0.055, half_length, 0.02}, wood);
  }
  for (const double z : {0.62, 0.78}) {
    builder.AddBox({-0.24, 0.0, z}, {0.02, half_length, 0.06}, wood);
  }
  for (const double side : {-0.8, 0.8}) {
    builder.AddBox({-0.03, side * half_length, 0.22}, {0.18, 0.03, 0.22}, metal);
    builder.AddBox({-0.26, side * half_length, 0.6}, {0.02, 0.03, 0.25}, metal);
  }
}

}  // namespace

Body MakeBody(BodyKind kind,
              const std::vector<PhotoTexture>& photos,
              RandomStream& random,
              std::vector<Surface>& surfaces) {
  Builder builder(photos, random, surfaces);
  switch (kind) {
    case BodyKind::kPerson:
      MakePerson(builder);
      break;
    case BodyKind::kCar:
      MakeCar(builder);
      break;
    case BodyKind::kTable:
      MakeTable(builder);
      break;
    case BodyKind::kChair:
      MakeChair(builder);
      break;
    case BodyKind::kSofa:
      MakeSofa(builder);
      break;
    case BodyKind::kShelf:
      MakeShelf(builder);
      break;
    case BodyKind::kCupboard:
      MakeCupboard(builder);
      break;
    case BodyKind::kFloorLamp:
      MakeFloorLamp(builder);
      break;
    case BodyKind::kPlant:
      MakePlant(builder);
      break;
    case BodyKind::kTree:
      MakeTree(builder);
      break;
    case BodyKind::kBin:
      MakeBin(builder);
      break;
    case BodyKind::kParcel:
      MakeParcel(builder);
      break;
    case BodyKind::kBall:
      MakeBallBody(builder);
      break;
    case BodyKind::kStack:
      MakeStack(builder);
      break;
    case BodyKind::kBottle:
      MakeBottle(builder);
      break;
    case BodyKind::kBench:
      MakeBench(builder);
      break;
  }
  return builder.Finish(kind);
}

std::vector<Piece> PlaceBody(const Body& body, const Stand& stand) {
  const Eigen::Matrix3d world_from_body =
      Eigen::AngleAxisd(stand.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  std::vector<Piece> pieces = body.pieces;
  for (Piece& piece : pieces) {
    Solid& solid = piece.solid;
    solid.centre_in_world = stand.place + stand.size * (world_from_body * solid.centre_in_world);
    solid.local_from_world_rotation *= world_from_body.transpose();
    solid.half_size *= stand.size;
  }
  return pieces;
}

Body Deform(const Body& body, double strength, RandomStream& random) {
  Body deformed = body;
  const double whole = std::exp(0.5 * strength * random.Uniform(-1.0, 1.0));
  for (Piece& piece : deformed.pieces) {
    Solid& solid = piece.solid;
    for (int axis = 0; axis < 3; ++axis) {
      const double size = solid.half_size[axis];
      solid.centre_in_world[axis] += strength * size * random.Uniform(-1.0, 1.0);
      solid.half_size[axis] = size * std::exp(strength * random.Uniform(-1.0, 1.0));
    }
    solid.centre_in_world *= whole;
    solid.half_size *= whole;
  }
  return deformed;
}

}  // namespace vgtw
