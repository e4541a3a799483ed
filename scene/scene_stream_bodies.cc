// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_bodies.h"

#include "scene/scene_stream_builder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

constexpr double kPi = std::numbers::pi;

void BuildPerson(BodyBuilder& builder) {
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
    const int bag = builder.Look(SurfaceUse::kThing, 0.3);
    builder.AddBox({0.0, 0.34 * width, 0.65 * height}, {0.18, 0.06, 0.16}, bag);
  }
  if (builder.Chance(0.25)) {
    const int rucksack = builder.Look(SurfaceUse::kThing, 0.3);
    builder.AddBox({-0.20 * width, 0.0, 1.25 * height}, {0.09, 0.15, 0.22}, rucksack);
  }
}

void AddWheels(BodyBuilder& builder, double half_length) {
  const int rubber = builder.Look(SurfaceUse::kRubber, 0.5);
  const int lamp = builder.Look(SurfaceUse::kPaint, 0.2);
  for (const double side : {-1.0, 1.0}) {
    builder.AddBox({half_length, side * 0.62, 0.62}, {0.03, 0.14, 0.08}, lamp);
    for (const double end : {-0.62, 0.62}) {
      const Eigen::Vector3d axle(end * half_length, side * 0.78, 0.33);
      Solid& wheel = builder.Add(ShapeKind::kCylinder, axle, {0.33, 0.33, 0.11}, rubber);
      Turn(wheel, 0.5 * kPi, Eigen::Vector3d::UnitX());
    }
  }
}

void BuildCar(BodyBuilder& builder) {
  const int paint = builder.Look(SurfaceUse::kPaint, 2.0);
  const int glass = builder.Look(SurfaceUse::kGlass, 1.0);
  const bool is_van = builder.Chance(0.3);
  const double half_length = builder.Draw(1.7, 2.3);
  const double body_half_height = is_van ? 0.42 : 0.3;
  const double deck = 0.3 + 2.0 * body_half_height;
  const Eigen::Vector3d body_half_size(half_length, 0.85, body_half_height);
  builder.AddBox({0.0, 0.0, 0.3 + body_half_height}, body_half_size, paint);
  const double cabin_half_height = is_van ? 0.42 : 0.26;
  const double cabin_length = (is_van ? 0.85 : 0.55) * half_length;
  const double cabin_x = is_van ? -0.1 * half_length : -0.1;
  builder.AddBox({cabin_x, 0.0, deck + cabin_half_height},
                 {cabin_length, 0.76, cabin_half_height},
                 is_van ? paint : glass);
  const double roof = deck + 2.0 * cabin_half_height;
  builder.AddBox({cabin_x, 0.0, roof}, {0.95 * cabin_length, 0.78, 0.04}, paint);
  AddWheels(builder, half_length);
}

void BuildPlant(BodyBuilder& builder) {
  const double pot_height = builder.Draw(0.2, 0.4);
  const double pot_radius = builder.Draw(0.12, 0.22);
  const int pot = builder.Look(SurfaceUse::kThing, 0.3);
  builder.AddColumn(Eigen::Vector3d::Zero(), pot_radius, pot_height, pot);
  const double radius = builder.Draw(0.2, 0.38);
  const double stem = builder.Draw(0.2, 0.5);
  builder.AddCrown(radius, pot_height + stem, 3 + builder.Index(3));
}

void BuildTree(BodyBuilder& builder) {
  const double trunk_height = builder.Draw(1.6, 2.8);
  const double trunk_radius = builder.Draw(0.1, 0.2);
  const double radius = builder.Draw(0.9, 1.6);
  const int bark = builder.Look(SurfaceUse::kWood, 0.4);
  builder.AddColumn(Eigen::Vector3d::Zero(), trunk_radius, trunk_height + 0.6, bark);
  builder.AddCrown(radius, trunk_height + 0.6 * radius, 4 + builder.Index(3));
}

void BuildBin(BodyBuilder& builder) {
  const double radius = builder.Draw(0.15, 0.3);
  const double height = builder.Draw(0.4, 0.9);
  const int side = builder.Look(SurfaceUse::kThing, 0.5);
  const int lid = builder.Look(SurfaceUse::kPaint, 0.3);
  builder.AddColumn(Eigen::Vector3d::Zero(), radius, height, side);
  builder.AddColumn({0.0, 0.0, height}, 1.08 * radius, 0.06, lid);
}

void BuildParcel(BodyBuilder& builder) {
  const Eigen::Vector3d half_size{
      builder.Draw(0.15, 0.4), builder.Draw(0.15, 0.4), builder.Draw(0.12, 0.4)};
  const int paper = builder.Look(SurfaceUse::kThing, 2.0 * half_size.x());
  builder.AddBox({0.0, 0.0, half_size.z()}, half_size, paper);
}

void BuildBall(BodyBuilder& builder) {
  const double radius = builder.Draw(0.12, 0.35);
  const int rubber = builder.Look(SurfaceUse::kThing, radius);
  builder.AddBall({0.0, 0.0, radius}, {radius, radius, radius}, rubber);
}

void BuildStack(BodyBuilder& builder) {
  const size_t num_boxes = 2 + builder.Index(4);
  Eigen::Vector2d half_size{builder.Draw(0.2, 0.4), builder.Draw(0.15, 0.35)};
  double z = 0.0;
  for (size_t i = 0; i < num_boxes; ++i) {
    const double half_height = builder.Draw(0.03, 0.16);
    const Eigen::Vector3d centre{
        builder.Draw(-0.04, 0.04), builder.Draw(-0.04, 0.04), z + half_height};
    const int cover = builder.Look(SurfaceUse::kThing, half_size.x());
    Solid& box = builder.AddBox(centre, {half_size.x(), half_size.y(), half_height}, cover);
    Turn(box, builder.Draw(-0.4, 0.4), Eigen::Vector3d::UnitZ());
    z += 2.0 * half_height;
    half_size *= builder.Draw(0.8, 1.0);
  }
}

void BuildBottle(BodyBuilder& builder) {
  const double radius = builder.Draw(0.1, 0.2);
  const double height = builder.Draw(0.3, 0.6);
  const double neck = builder.Draw(0.15, 0.3);
  const int label = builder.Look(SurfaceUse::kThing, 2.0 * radius);
  const int cap = builder.Look(SurfaceUse::kPaint, radius);
  builder.AddColumn(Eigen::Vector3d::Zero(), radius, height, label);
  builder.AddBall({0.0, 0.0, height}, {radius, radius, 0.6 * radius}, label);
  builder.AddColumn({0.0, 0.0, height}, 0.35 * radius, neck, cap);
}

void Build(BodyKind kind, BodyBuilder& builder) {
  switch (kind) {
    case BodyKind::kPerson:
      return BuildPerson(builder);
    case BodyKind::kCar:
      return BuildCar(builder);
    case BodyKind::kTable:
      return BuildTable(builder);
    case BodyKind::kChair:
      return BuildChair(builder);
    case BodyKind::kSofa:
      return BuildSofa(builder);
    case BodyKind::kShelf:
      return BuildShelf(builder);
    case BodyKind::kCupboard:
      return BuildCupboard(builder);
    case BodyKind::kFloorLamp:
      return BuildFloorLamp(builder);
    case BodyKind::kPlant:
      return BuildPlant(builder);
    case BodyKind::kTree:
      return BuildTree(builder);
    case BodyKind::kBin:
      return BuildBin(builder);
    case BodyKind::kParcel:
      return BuildParcel(builder);
    case BodyKind::kBall:
      return BuildBall(builder);
    case BodyKind::kStack:
      return BuildStack(builder);
    case BodyKind::kBottle:
      return BuildBottle(builder);
    case BodyKind::kBench:
      return BuildBench(builder);
  }
}

}  // namespace

Body MakeBody(BodyKind kind,
              const std::vector<PhotoTexture>& photos,
              RandomStream& random,
              std::vector<Surface>& surfaces) {
  BodyBuilder builder(photos, random, surfaces);
  Build(kind, builder);
  return builder.Finish(kind);
}

std::vector<Piece> PlaceBody(const Body& body, const Stand& stand) {
  const Eigen::Matrix3d world_from_body =
      Eigen::AngleAxisd(stand.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  std::vector<Piece> pieces = body.pieces;
  for (Piece& piece : pieces) {
    Solid& solid = piece.solid;
    solid.centre_in_world = stand.place + stand.size * (world_from_body * solid.centre_in_world);
    solid.local_from_world_rotation = solid.local_from_world_rotation * world_from_body.transpose();
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
