// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_cameras.h"

#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vgtw {
namespace {

using Eigen::Vector3d;

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

Vector3d FromTarget(double azimuth_deg, double elevation_deg) {
  const double azimuth_rad = kRadPerDeg * azimuth_deg;
  const double elevation_rad = kRadPerDeg * elevation_deg;
  return {std::cos(elevation_rad) * std::cos(azimuth_rad),
          std::cos(elevation_rad) * std::sin(azimuth_rad),
          std::sin(elevation_rad)};
}

struct Pose {
  Vector3d centre;
  Vector3d target;
};

// Positions along the path, from -0.5 to 0.5.
double PathPosition(int view_idx, int num_views) {
  return static_cast<double>(view_idx) / (num_views - 1) - 0.5;
}

std::vector<Pose> Arc(const Stage& stage, int num_views, double extent, RandomStream& random) {
  constexpr double kMaxStepDeg = 25.0;
  const double drawn_deg = random.Uniform(10.0, 90.0);
  const double arc_deg = extent * std::min(drawn_deg, kMaxStepDeg * (num_views - 1));
  const double rise_deg = extent * random.Uniform(-12.0, 12.0);
  const double approach = extent * random.Uniform(-0.3, 0.3);
  std::vector<Pose> poses;
  for (int i = 0; i < num_views; ++i) {
    const double s = PathPosition(i, num_views);
    const Vector3d direction =
        FromTarget(stage.azimuth_deg + arc_deg * s, stage.elevation_deg + rise_deg * s);
    poses.push_back(
        {stage.target + (1.0 + approach * s) * stage.distance * direction, stage.target});
  }
  return poses;
}

std::vector<Pose> Forward(const Stage& stage, int num_views, double extent, RandomStream& random) {
  const double travel = extent * random.Uniform(0.12, 0.3) * std::min(num_views - 1, 3);
  const double drift = extent * random.Uniform(-0.15, 0.15);
  const Vector3d direction = FromTarget(stage.azimuth_deg, stage.elevation_deg);
  const Vector3d side = direction.cross(Vector3d::UnitZ()).normalized();
  std::vector<Pose> poses;
  for (int i = 0; i < num_views; ++i) {
    const double s = PathPosition(i, num_views);
    const Vector3d offset = drift * s * stage.distance * side;
    poses.push_back({stage.target + (1.0 - travel * s) * stage.distance * direction + offset,
                     stage.target + offset});
  }
  return poses;
}

std::vector<Pose> Lateral(const Stage& stage, int num_views, double extent, RandomStream& random) {
  const double step = extent * random.Uniform(0.06, 0.22) * stage.distance;
  const double slope = random.Uniform(-0.4, 0.4);
  const Vector3d direction = FromTarget(stage.azimuth_deg, stage.elevation_deg);
  const Vector3d side =
      (direction.cross(Vector3d::UnitZ()).normalized() + slope * Vector3d::UnitZ()).normalized();
  std::vector<Pose> poses;
  for (int i = 0; i < num_views; ++i) {
    const Vector3d offset = step * (i - 0.5 * (num_views - 1)) * side;
    poses.push_back({stage.target + stage.distance * direction + offset, stage.target + offset});
  }
  return poses;
}

std::vector<Pose> Walk(const Stage& stage, int num_views, double extent, RandomStream& random) {
  const double step = extent * random.Uniform(0.05, 0.18) * stage.distance;
  const double jitter = extent * random.Uniform(0.02, 0.12) * stage.distance;
  Vector3d centre =
      stage.target + stage.distance * FromTarget(stage.azimuth_deg, stage.elevation_deg);
  std::vector<Pose> poses;
  for (int i = 0; i < num_views; ++i) {
    const Vector3d target = stage.target + jitter * random.NormalVector();
    poses.push_back({centre, target});
    const Vector3d move = random.NormalVector();
    centre += step * Vector3d(move.x(), move.y(), 0.4 * move.z());
  }
  return poses;
}

std::vector<Pose> DrawPath(const Stage& stage, int num_views, double extent, RandomStream& random) {
  switch (random.Index(5)) {
    case 0:
      return Forward(stage, num_views, extent, random);
    case 1:
      return Lateral(stage, num_views, extent, random);
    case 2:
      return Walk(stage, num_views, extent, random);
    default:
      return Arc(stage, num_views, extent, random);
  }
}

// Whether the point is inside a solid, or nearer to it than `margin`.
bool IsInside(const Solid& solid, const Vector3d& point, double margin) {
  if (solid.kind == ShapeKind::kRoom || solid.kind == ShapeKind::kDome) return false;
  const Vector3d local = solid.local_from_world_rotation * (point - solid.centre_in_world);
  return (local.cwiseAbs().array() <= solid.half_size.array() + margin).all();
}

bool IsFree(const Stage& stage, const Vector3d& centre) {
  return stage.space.contains(centre) &&
         std::none_of(stage.pieces.begin(), stage.pieces.end(), [&](const Piece& piece) {
           return IsInside(piece.solid, centre, 0.5 * stage.min_depth);
         });
}

Rigid3d ToRigid(const Pose& pose, const Stage& stage, RandomStream& random) {
  const double roll_deg = 2.0 * random.Normal();
  const Vector3d jitter = 0.03 * stage.distance * random.NormalVector();
  const Rigid3d upright = LookAt(pose.centre, pose.target + jitter, Vector3d::UnitZ());
  return Rigid3d{RotationAboutAxis(Vector3d::UnitZ(), roll_deg), Vector3d::Zero()} * upright;
}

Camera DrawCamera(const CameraOptions& options, double focal_length_factor) {
  const double focal_length = focal_length_factor * std::max(options.width, options.height);
  return MakePinhole(static_cast<uint64_t>(options.width),
                     static_cast<uint64_t>(options.height),
                     focal_length,
                     focal_length);
}

Camera MakeCoarse(const Camera& camera) {
  constexpr double kCoarseSide = 32.0;
  const double scale =
      std::min(1.0, kCoarseSide / static_cast<double>(std::max(camera.width, camera.height)));
  const auto side = [scale](uint64_t size) {
    return static_cast<uint64_t>(std::max(1.0, std::round(scale * static_cast<double>(size))));
  };
  return Rescale(camera, side(camera.width), side(camera.height));
}

StreamView SeeCoarsely(const Stage& stage, const Camera& camera, const Rigid3d& cam_from_world) {
  StreamView view{camera, cam_from_world, MakeCoarse(camera), HitMap(0, 0)};
  view.coarse = HitMap(static_cast<int>(view.coarse_camera.width),
                       static_cast<int>(view.coarse_camera.height));
  CastInto(SeePieces(stage.pieces, view.coarse_camera, cam_from_world), 0, view.coarse);
  return view;
}

// Share of the coarse pixels of `from` whose static point is visible in `to`.
double Overlap(const StreamView& from, const StreamView& to) {
  constexpr double kSameDepth = 0.1;  // relative; coarse pixels are large
  const Rigid3d to_from_from = to.cam_from_world * Inverse(from.cam_from_world);
  const Eigen::Matrix3d rotation = to_from_from.rotation.toRotationMatrix();
  const auto focal_lengths = [](const Camera& camera) {
    return Eigen::Array2d(camera.FocalLengthX(), camera.FocalLengthY());
  };
  const Eigen::Array2d from_focal = focal_lengths(from.coarse_camera);
  const Eigen::Array2d to_focal = focal_lengths(to.coarse_camera);
  const Eigen::Array2d from_centre = from.coarse_camera.PrincipalPoint();
  const Eigen::Array2d to_centre = to.coarse_camera.PrincipalPoint();
  int num_seen = 0;
  for (int y = 0; y < from.coarse.depth.height(); ++y) {
    for (int x = 0; x < from.coarse.depth.width(); ++x) {
      const Eigen::Vector2d ray = (Eigen::Array2d(x + 0.5, y + 0.5) - from_centre) / from_focal;
      const Vector3d point =
          from.coarse.depth(x, y) * (rotation * ray.homogeneous()) + to_from_from.translation;
      if (point.z() <= 0.0) continue;
      const Eigen::Array2d pixel = to_focal * point.hnormalized().array() + to_centre;
      const bool is_inside = (pixel >= 0.0).all() && pixel.x() < 2.0 * to_centre.x() &&
                             pixel.y() < 2.0 * to_centre.y();
      if (!is_inside) continue;
      const float depth = to.coarse.depth(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
      if (point.z() <= (1.0 + kSameDepth) * depth) ++num_seen;
    }
  }
  return static_cast<double>(num_seen) / static_cast<double>(from.coarse.depth.size());
}

bool IsWorthwhile(const StreamView& view, const Stage& stage) {
  const auto& depths = view.coarse.depth.data();
  const float nearest = *std::min_element(depths.begin(), depths.end());
  const float farthest = *std::max_element(depths.begin(), depths.end());
  return nearest >= static_cast<float>(stage.min_depth) && farthest < HitMap(1, 1).depth(0, 0) &&
         MedianDepth(view) >= 0.35 * stage.distance;
}

std::optional<std::vector<StreamView>> TryPath(const Stage& stage,
                                               const CameraOptions& options,
                                               double extent,
                                               RandomStream& random) {
  constexpr double kMinOverlap = 0.5;
  const std::vector<Pose> poses = DrawPath(stage, options.num_views, extent, random);
  const double focal_length_factor = random.Uniform(0.6, 1.4);
  const bool zooms = random.Chance(0.2);
  std::vector<StreamView> views;
  for (const Pose& pose : poses) {
    if (!IsFree(stage, pose.centre)) return std::nullopt;
    const double zoom = zooms ? random.Uniform(0.85, 1.15) : 1.0;
    const Camera camera = DrawCamera(options, std::clamp(zoom * focal_length_factor, 0.6, 1.4));
    views.push_back(SeeCoarsely(stage, camera, ToRigid(pose, stage, random)));
    if (!IsWorthwhile(views.back(), stage)) return std::nullopt;
    if (views.size() < 2) continue;
    const StreamView& before = views[views.size() - 2];
    if (std::min(Overlap(before, views.back()), Overlap(views.back(), before)) < kMinOverlap) {
      return std::nullopt;
    }
  }
  return views;
}

}  // namespace

double MedianDepth(const StreamView& view) {
  return Median({view.coarse.depth.data().begin(), view.coarse.depth.data().end()});
}

std::optional<std::vector<StreamView>> DrawViews(const Stage& stage,
                                                 const CameraOptions& options,
                                                 RandomStream& random) {
  constexpr int kMaxTries = 8;
  double extent = 1.0;
  for (int i = 0; i < kMaxTries; ++i, extent *= 0.85) {
    if (auto views = TryPath(stage, options, extent, random)) return views;
  }
  return std::nullopt;
}

}  // namespace vgtw
