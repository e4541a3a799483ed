// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_distractors.h"

#include "scene/scene_stream.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ActorsByView = std::vector<Actors>;

constexpr double kPi = std::numbers::pi;

// Share of coarse pixels where something stands before the static scene.
class CoverMeter {
 public:
  explicit CoverMeter(const std::vector<StreamView>& views) : views_(views) {
    for (const StreamView& view : views) hits_.push_back(view.coarse);
    for (HitMap& hits : hits_) std::fill(hits.index.data().begin(), hits.index.data().end(), -1);
    covers_.assign(views.size(), 0.0);
  }

  double cover() const { return Mean(covers_); }

  // Adds the pieces unless they cover nothing, or all together too much.
  bool Add(const ActorsByView& actors, double max_cover) {
    constexpr double kMaxCoverOfView = 0.6;
    constexpr double kMinGain = 0.004;
    std::vector<HitMap> hits = hits_;
    std::vector<double> covers;
    for (size_t i = 0; i < views_.size(); ++i) {
      const StreamView& view = views_[i];
      CastInto(SeePieces(actors[i].pieces, view.coarse_camera, view.cam_from_world), 0, hits[i]);
      covers.push_back(Cover(hits[i]));
      if (covers.back() > kMaxCoverOfView) return false;
    }
    if (Mean(covers) > max_cover || Mean(covers) < Mean(covers_) + kMinGain) return false;
    hits_ = std::move(hits);
    covers_ = std::move(covers);
    return true;
  }

 private:
  static double Mean(const std::vector<double>& values) {
    double sum = 0.0;
    for (const double value : values) sum += value;
    return sum / static_cast<double>(values.size());
  }
  static double Cover(const HitMap& hits) {
    const auto& indices = hits.index.data();
    const auto count =
        std::count_if(indices.begin(), indices.end(), [](int32_t i) { return i >= 0; });
    return static_cast<double>(count) / static_cast<double>(indices.size());
  }

  const std::vector<StreamView>& views_;
  std::vector<HitMap> hits_;
  std::vector<double> covers_;
};

class Director {
 public:
  Director(const Stage& stage, const std::vector<StreamView>& views, RandomStream& random)
      : stage_(stage), views_(views), random_(random) {
    for (const StreamView& view : views) median_depths_.push_back(MedianDepth(view));
  }

  ActorsByView Direct(const CastMember& member, DistractorKind way) {
    switch (way) {
      case kMovingDistractors:
        return random_.Chance(0.5) ? Pass(member) : Jump(member);
      case kAbsentDistractors:
        return StayAway(member);
      case kDeformingDistractors:
        return Change(member);
      default:
        return Occlude(member);
    }
  }

 private:
  // A place on the floor that a view sees, free if one is found soon.
  Vector3d DrawPlace(const CastMember& member, size_t view_idx) {
    constexpr int kMaxTries = 8;
    Vector3d place;
    for (int i = 0; i < kMaxTries; ++i) {
      place = DrawPlaceInView(view_idx);
      if (stage_.IsFree(place.head<2>(), member.size * member.body.radius)) break;
    }
    return place;
  }

  // The same away from `places`, where the floor is large enough.
  Vector3d DrawPlaceElsewhere(const CastMember& member,
                              size_t view_idx,
                              const std::vector<Vector3d>& places) {
    constexpr int kMaxTries = 6;
    const double min_step = 0.5 * member.size * member.body.radius;
    for (int i = 0; i < kMaxTries; ++i) {
      const Vector3d place = DrawPlace(member, view_idx);
      const auto is_near = [&](const Vector3d& other) { return (other - place).norm() < min_step; };
      if (std::none_of(places.begin(), places.end(), is_near)) return place;
    }
    const double yaw_rad = DrawYaw();
    return places.back() + min_step * Vector3d(std::cos(yaw_rad), std::sin(yaw_rad), 0.0);
  }

  Vector3d DrawPlaceInView(size_t view_idx) {
    const StreamView& view = views_[view_idx];
    const Eigen::Matrix3d cam_from_world = view.cam_from_world.rotation.toRotationMatrix();
    const Vector2d right = cam_from_world.row(0).head<2>().transpose().normalized();
    const Vector2d ahead = cam_from_world.row(2).head<2>().transpose().normalized();
    const double half_width = view.camera.PrincipalPoint().x() / view.camera.FocalLengthX();
    const double depth = random_.Uniform(0.35, 0.95) * median_depths_[view_idx];
    const double lateral = random_.Uniform(-0.8, 0.8) * half_width * depth;
    const Vector2d centre = OriginInSource(view.cam_from_world).head<2>();
    // Where the camera looks down, the floor is nearer than the horizontal distance says.
    const double tilt = cam_from_world.row(2).head<2>().norm();
    const Vector2d wanted = centre + tilt * depth * ahead + lateral * right;
    const Vector2d place = wanted.cwiseMax(stage_.floor.min()).cwiseMin(stage_.floor.max());
    return {place.x(), place.y(), stage_.floor_height};
  }

  size_t DrawView() { return random_.Index(views_.size()); }
  double DrawYaw() { return random_.Uniform(0.0, 2.0 * kPi); }

  // The body as it looks in one view: people swing their limbs.
  Body Animate(const CastMember& member) {
    constexpr double kGait = 0.08;
    return member.body.kind == BodyKind::kPerson ? Deform(member.body, kGait, random_)
                                                 : member.body;
  }

  static Actors OnFloor(const Body& body, const Stand& stand) {
    return {PlaceBody(body, stand), {{stand.place.head<2>(), stand.size * body.radius}}};
  }

  // On a straight way through the scene, by less than its size to a few sizes a view.
  ActorsByView Pass(const CastMember& member) {
    const size_t seen_from = DrawView();
    const Vector3d place = DrawPlace(member, seen_from);
    const double yaw_rad = DrawYaw();
    const double step = random_.Uniform(0.6, 2.5) * member.size * std::min(member.body.radius, 1.2);
    const Vector3d direction(std::cos(yaw_rad), std::sin(yaw_rad), 0.0);
    ActorsByView actors;
    for (size_t i = 0; i < views_.size(); ++i) {
      const double steps = static_cast<double>(i) - static_cast<double>(seen_from);
      const Vector3d here = place + steps * step * direction;
      actors.push_back(OnFloor(Animate(member), {here, yaw_rad, member.size}));
    }
    return actors;
  }

  // Somewhere else in every view.
  ActorsByView Jump(const CastMember& member) {
    const bool turns = random_.Chance(0.5);
    double yaw_rad = DrawYaw();
    std::vector<Vector3d> places;
    ActorsByView actors;
    for (size_t i = 0; i < views_.size(); ++i) {
      const Vector3d place = DrawPlaceElsewhere(member, i, places);
      places.push_back(place);
      if (turns) yaw_rad = DrawYaw();
      actors.push_back(OnFloor(Animate(member), {place, yaw_rad, member.size}));
    }
    return actors;
  }

  // In one place, but not in all views.
  ActorsByView StayAway(const CastMember& member) {
    const size_t present = DrawView();
    const size_t absent = (present + 1 + random_.Index(views_.size() - 1)) % views_.size();
    const Vector3d place = DrawPlace(member, present);
    const Actors placed = OnFloor(member.body, {place, DrawYaw(), member.size});
    ActorsByView actors(views_.size());
    for (size_t i = 0; i < views_.size(); ++i) {
      const bool is_here = random_.Chance(0.5);
      if (i == present || (i != absent && is_here)) actors[i] = placed;
    }
    return actors;
  }

  // In one place, another shape in every view.
  ActorsByView Change(const CastMember& member) {
    const Vector3d place = DrawPlace(member, DrawView());
    const double yaw_rad = DrawYaw();
    const double strength = random_.Uniform(0.2, 0.45);
    ActorsByView actors;
    for (size_t i = 0; i < views_.size(); ++i) {
      const double turned_rad = yaw_rad + random_.Uniform(-0.5, 0.5);
      const Body body = Deform(member.body, strength, random_);
      actors.push_back(OnFloor(body, {place, turned_rad, member.size}));
    }
    return actors;
  }

  // Close to the camera, reaching in from a border.
  ActorsByView Occlude(const CastMember& member) {
    const size_t present = DrawView();
    ActorsByView actors(views_.size());
    for (size_t i = 0; i < views_.size(); ++i) {
      const bool is_here = random_.Chance(0.6);
      if (i == present || is_here) actors[i].pieces = PlaceAtBorder(member, i);
    }
    return actors;
  }

  std::vector<Piece> PlaceAtBorder(const CastMember& member, size_t view_idx) {
    const StreamView& view = views_[view_idx];
    const double depth = random_.Uniform(0.2, 0.4) * median_depths_[view_idx];
    const Vector2d half_view = view.camera.PrincipalPoint() / view.camera.MeanFocalLength();
    const double half_size = random_.Uniform(0.3, 0.9) * half_view.maxCoeff() * depth;
    const double side = random_.Chance(0.5) ? 1.0 : -1.0;
    const double along = random_.Uniform(-0.6, 0.6);
    const Vector2d border = random_.Chance(0.3) ? Vector2d(along, 1.0) : Vector2d(side, along);
    const Vector2d ray = border.cwiseProduct(half_view);
    const Vector3d middle = Inverse(view.cam_from_world) * (depth * ray.homogeneous());
    const double size = half_size / std::max(member.body.radius, 0.5 * member.body.height);
    const Vector3d foot = middle - 0.5 * size * member.body.height * Vector3d::UnitZ();
    return PlaceBody(member.body, {foot, DrawYaw(), size});
  }

  const Stage& stage_;
  const std::vector<StreamView>& views_;
  RandomStream& random_;
  std::vector<double> median_depths_;
};

void Append(const ActorsByView& more, ActorsByView& actors) {
  for (size_t i = 0; i < actors.size(); ++i) {
    auto& [pieces, footprints] = actors[i];
    pieces.insert(pieces.end(), more[i].pieces.begin(), more[i].pieces.end());
    footprints.insert(footprints.end(), more[i].footprints.begin(), more[i].footprints.end());
  }
}

}  // namespace

std::optional<ActorsByView> DrawDistractors(const Stage& stage,
                                            const std::vector<StreamView>& views,
                                            const std::vector<CastMember>& cast,
                                            uint32_t kinds,
                                            RandomStream& random) {
  constexpr int kMaxTries = 60;
  // Coarse pixels are off by some percent of the share.
  constexpr double kMargin = 1.15;
  std::vector<DistractorKind> ways;
  for (const DistractorKind way : {kMovingDistractors,
                                   kMovingDistractors,
                                   kAbsentDistractors,
                                   kDeformingDistractors,
                                   kOccludingDistractors}) {
    if ((kinds & way) != 0) ways.push_back(way);
  }
  const double wanted = random.Uniform(0.04, 0.26);
  CoverMeter meter(views);
  Director director(stage, views, random);
  ActorsByView distractors(views.size());
  for (int i = 0; i < kMaxTries && meter.cover() < wanted; ++i) {
    const CastMember& member = cast[random.Index(cast.size())];
    const DistractorKind way = ways[random.Index(ways.size())];
    const ActorsByView actors = director.Direct(member, way);
    if (meter.Add(actors, kMaxDistractorCover / kMargin)) Append(actors, distractors);
  }
  if (meter.cover() < kMargin * kMinDistractorCover) return std::nullopt;
  return distractors;
}

}  // namespace vgtw
