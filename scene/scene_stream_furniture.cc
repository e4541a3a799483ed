// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_builder.h"

namespace vgtw {
namespace {

// Cups, boxes and books on a table top.
void LayTable(BodyBuilder& builder, const Eigen::Vector2d& half_size, double height) {
  const size_t num_things = builder.Index(4);
  for (size_t i = 0; i < num_things; ++i) {
    const double size = builder.Draw(0.05, 0.14);
    const Eigen::Vector2d share{builder.Draw(-0.8, 0.8), builder.Draw(-0.8, 0.8)};
    const Eigen::Vector3d place = share.cwiseProduct(half_size).homogeneous().cwiseProduct(
        Eigen::Vector3d(1.0, 1.0, height + 0.025));
    const int look = builder.Look(SurfaceUse::kThing, 2.0 * size);
    if (builder.Chance(0.5)) {
      builder.AddColumn(place, 0.6 * size, 2.0 * size, look);
    } else {
      const Eigen::Vector3d centre = place + size * Eigen::Vector3d::UnitZ();
      builder.AddBox(centre, {1.4 * size, size, size}, look);
    }
  }
}

// Books on a board, from one side to somewhere before the other.
void FillBoard(BodyBuilder& builder, double half_width, double board_height) {
  const double end = builder.Draw(-0.3, 0.95) * half_width;
  for (double y = -0.93 * half_width; y < end;) {
    const double half_thickness = builder.Draw(0.04, 0.11);
    const double half_height = builder.Draw(0.09, 0.16);
    const double x = builder.Draw(-0.04, 0.02);
    y += half_thickness;
    builder.AddBox({x, y, board_height + half_height},
                   {0.11, half_thickness, half_height},
                   builder.Look(SurfaceUse::kThing, 0.2));
    y += half_thickness;
  }
}

}  // namespace

void BuildTable(BodyBuilder& builder) {
  const Eigen::Vector2d half_size{builder.Draw(0.4, 0.9), builder.Draw(0.35, 0.6)};
  const double height = builder.Draw(0.45, 0.8);
  const int wood = builder.Look(SurfaceUse::kWood, 0.8);
  builder.AddBox({0.0, 0.0, height}, {half_size.x(), half_size.y(), 0.025}, wood);
  if (builder.Chance(0.3)) {
    builder.AddColumn(Eigen::Vector3d::Zero(), 0.06, height, wood);
  } else {
    builder.AddLegs(half_size, 0.03, height, wood);
  }
  LayTable(builder, half_size, height);
}

void BuildChair(BodyBuilder& builder) {
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

void BuildSofa(BodyBuilder& builder) {
  const double half_length = builder.Draw(0.5, 1.1);
  const int cloth = builder.Look(SurfaceUse::kCloth, 1.0);
  const int cushion = builder.Look(SurfaceUse::kThing, 0.4);
  builder.AddBox({0.0, 0.0, 0.2}, {0.42, half_length, 0.2}, cloth);
  builder.AddBox({-0.34, 0.0, 0.6}, {0.1, half_length, 0.25}, cloth);
  for (const double side : {-1.0, 1.0}) {
    builder.AddBox({0.0, side * (half_length + 0.08), 0.3}, {0.42, 0.09, 0.3}, cloth);
  }
  const double y = builder.Draw(-0.7, 0.7) * half_length;
  Solid& pillow = builder.AddBall({-0.15, y, 0.56}, {0.1, 0.22, 0.2}, cushion);
  Turn(pillow, -0.3, Eigen::Vector3d::UnitY());
}

void BuildShelf(BodyBuilder& builder) {
  constexpr double kHalfDepth = 0.16;
  const double half_width = builder.Draw(0.35, 0.7);
  const double height = builder.Draw(0.9, 2.1);
  const int wood = builder.Look(SurfaceUse::kWood, 0.6);
  builder.AddBox({-kHalfDepth, 0.0, 0.5 * height}, {0.015, half_width, 0.5 * height}, wood);
  for (const double side : {-1.0, 1.0}) {
    builder.AddBox({0.0, side * half_width, 0.5 * height}, {kHalfDepth, 0.02, 0.5 * height}, wood);
  }
  const int num_boards = static_cast<int>(height / 0.4) + 1;
  for (int board = 0; board < num_boards; ++board) {
    const double z = height * board / (num_boards - 1);
    builder.AddBox({0.0, 0.0, z}, {kHalfDepth, half_width, 0.015}, wood);
    if (board + 1 < num_boards) FillBoard(builder, half_width, z);
  }
}

void BuildCupboard(BodyBuilder& builder) {
  const Eigen::Vector3d half_size{
      builder.Draw(0.2, 0.35), builder.Draw(0.3, 0.8), builder.Draw(0.35, 1.1)};
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

void BuildFloorLamp(BodyBuilder& builder) {
  const double height = builder.Draw(1.2, 1.8);
  const int metal = builder.Look(SurfaceUse::kPaint, 0.5);
  const int shade = builder.Look(SurfaceUse::kCloth, 0.3);
  builder.AddColumn(Eigen::Vector3d::Zero(), 0.16, 0.03, metal);
  builder.AddColumn(Eigen::Vector3d::Zero(), 0.018, height, metal);
  if (builder.Chance(0.5)) {
    builder.AddColumn({0.0, 0.0, height - 0.1}, 0.19, 0.28, shade);
  } else {
    builder.AddBall({0.0, 0.0, height + 0.1}, {0.17, 0.17, 0.17}, shade);
  }
}

void BuildBench(BodyBuilder& builder) {
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

}  // namespace vgtw
