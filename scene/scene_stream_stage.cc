// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_stage.h"

#include "scene/scene_stream.h"
#include "scene/scene_stream_furnisher.h"

#include <algorithm>
#include <initializer_list>
#include <utility>

namespace vgtw {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

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

}  // namespace

int Furnisher::Look(SurfaceUse use, double size) {
  stage_.surfaces.push_back(MakeSurface(use, size, photos_, random_));
  return static_cast<int>(stage_.surfaces.size()) - 1;
}

Solid& Furnisher::Add(ShapeKind kind,
                      const Vector3d& centre,
                      const Vector3d& half_size,
                      int surface) {
  stage_.pieces.push_back({{kind, Eigen::Matrix3d::Identity(), centre, half_size}, surface});
  return stage_.pieces.back().solid;
}

void Furnisher::Place(const Body& body, const Stand& stand) {
  const std::vector<Piece> pieces = PlaceBody(body, stand);
  stage_.pieces.insert(stage_.pieces.end(), pieces.begin(), pieces.end());
  stage_.footprints.push_back({stand.place.head<2>(), stand.size * body.radius});
}

void Furnisher::Scatter(const Body& body, double size) {
  constexpr int kMaxTries = 12;
  for (int i = 0; i < kMaxTries; ++i) {
    const Vector2d place = DrawPlaceOnFloor();
    if (!stage_.IsFree(place, size * body.radius)) continue;
    Place(body, {{place.x(), place.y(), stage_.floor_height}, DrawYaw(), size});
    return;
  }
}

void Furnisher::ScatterThings(size_t num_things) {
  for (size_t i = 0; i < num_things; ++i) {
    const BodyKind kind = DrawThing(stage_.layout, random_);
    const Body body = Make(kind);
    Scatter(body, DrawSize(kind, stage_.layout, random_));
  }
}

Vector2d Furnisher::DrawPlaceOnFloor() {
  const double x = Draw(stage_.floor.min().x(), stage_.floor.max().x());
  return {x, Draw(stage_.floor.min().y(), stage_.floor.max().y())};
}

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
  const size_t car_weight = stage.layout == Layout::kStreet ? 2 : 1;
  std::vector<DistractorKind> bodies;
  for (const auto& [kind, weight] : {std::pair{kPersonDistractors, size_t{2}},
                                     std::pair{kCarDistractors, car_weight},
                                     std::pair{kThingDistractors, size_t{2}}}) {
    if ((kinds & kind) != 0) bodies.insert(bodies.end(), weight, kind);
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
