// SPDX-License-Identifier: BSD-3-Clause
#include "scene/synthetic_world.h"

#include "scene/random.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

namespace vgtw {
namespace {

constexpr double kPi = std::numbers::pi;

// Scene units, at the default focal length. They grow with longer lenses, so that the middle keeps
// its size in the image.
constexpr double kRoomHalfSize = 8.0;
constexpr double kRoomHalfHeight = 2.5;
constexpr double kCameraDistance = 5.5;
constexpr double kCameraHeight = 1.6;
constexpr double kMiddleRadius = 1.9;
constexpr double kDefaultFocalFactor = 0.9;

double DistanceScale(const SyntheticOptions& options) {
  return std::max(1.0, options.focal_length_factor / kDefaultFocalFactor);
}

Camera MakeCamera(const SyntheticOptions& options) {
  const double focal_length = options.focal_length_factor * std::max(options.width, options.height);
  Camera camera = MakePinhole(static_cast<uint64_t>(options.width),
                              static_cast<uint64_t>(options.height),
                              focal_length,
                              focal_length);
  camera.camera_id = 1;
  camera.has_prior_focal_length = true;
  if (options.radial_distortion != 0.0) {
    camera.model = CameraModel::kSimpleRadial;
    camera.params = {
        focal_length, 0.5 * options.width, 0.5 * options.height, options.radial_distortion};
  }
  return camera;
}

// Position along the path, in [-1, 1].
double PathPosition(const SyntheticOptions& options, int view_idx) {
  if (options.num_views == 1) return 0.0;
  return 2.0 * view_idx / (options.num_views - 1) - 1.0;
}

Rigid3d OrbitPose(const SyntheticOptions& options, int view_idx) {
  const double angle_rad =
      0.5 * options.path_extent_deg * PathPosition(options, view_idx) * kPi / 180.0;
  const double distance =
      DistanceScale(options) * (kCameraDistance + 0.15 * std::sin(1.7 * view_idx));
  const double height = kCameraHeight + 0.25 * std::sin(1.1 * view_idx);
  const Eigen::Vector3d centre(
      distance * std::sin(angle_rad), -distance * std::cos(angle_rad), height);
  return LookAt(centre, {0.0, 0.0, 0.9}, Eigen::Vector3d::UnitZ());
}

Rigid3d ForwardPose(const SyntheticOptions& options, int view_idx) {
  constexpr double kTravel = 2.4;
  const double y = DistanceScale(options) * -6.2 + 0.5 * kTravel * PathPosition(options, view_idx);
  const Eigen::Vector3d centre(
      0.25 * std::sin(0.9 * view_idx), y, kCameraHeight + 0.1 * std::sin(1.3 * view_idx));
  const Eigen::Vector3d target(0.5 * std::sin(0.5 * view_idx), 0.0, 1.0);
  return LookAt(centre, target, Eigen::Vector3d::UnitZ());
}

Rigid3d GridPose(const SyntheticOptions& options, int view_idx) {
  constexpr double kSpacing = 0.45;
  const int num_columns = static_cast<int>(std::ceil(std::sqrt(options.num_views)));
  const int num_rows = (options.num_views + num_columns - 1) / num_columns;
  const double column = view_idx % num_columns - 0.5 * (num_columns - 1);
  const double row = view_idx / num_columns - 0.5 * (num_rows - 1);
  // A large array must not leave the room.
  const double spacing = std::min(kSpacing, 8.0 / num_columns);
  const double height = kCameraHeight - std::min(spacing, 2.6 / num_rows) * row;
  const Eigen::Vector3d centre(spacing * column, -DistanceScale(options) * kCameraDistance, height);
  return LookAt(centre, centre + Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ());
}

Rigid3d CameraPose(const SyntheticOptions& options, int view_idx) {
  switch (options.path) {
    case CameraPath::kForward:
      return ForwardPose(options, view_idx);
    case CameraPath::kGrid:
      return GridPose(options, view_idx);
    case CameraPath::kOrbit:
      break;
  }
  return OrbitPose(options, view_idx);
}

std::vector<View> MakeViews(const SyntheticOptions& options) {
  const int num_digits =
      std::max(3, static_cast<int>(std::to_string(options.num_views - 1).size()));
  std::vector<View> views;
  for (int i = 0; i < options.num_views; ++i) {
    std::string digits = std::to_string(i);
    digits.insert(0, static_cast<size_t>(num_digits) - digits.size(), '0');
    View view;
    view.name = "view_" + digits + ".png";
    view.camera = MakeCamera(options);
    view.cam_from_world = CameraPose(options, i);
    view.network_width = options.width;
    view.network_height = options.height;
    views.push_back(view);
  }
  return views;
}

// Bodies that stand on the floor without touching each other.
class Furnisher {
 public:
  Furnisher(const SyntheticOptions& options, std::vector<Shape>& shapes)
      : seed_(options.seed), random_(HashKey({options.seed, kFurnitureStream})), shapes_(shapes) {}

  // Draws a place by `draw_place(random)` until the body is free of the others.
  template <typename DrawPlace>
  void Add(ShapeKind kind, const Eigen::Vector3d& half_size, const DrawPlace& draw_place) {
    constexpr int kMaxTries = 200;
    const double radius = half_size.head<2>().norm();
    for (int i = 0; i < kMaxTries; ++i) {
      const Eigen::Vector2d place = draw_place(random_);
      const auto is_in_way = [&](const Footprint& other) {
        return (other.centre - place).norm() < 0.9 * (other.radius + radius);
      };
      if (std::any_of(footprints_.begin(), footprints_.end(), is_in_way)) continue;
      footprints_.push_back({place, radius});
      shapes_.push_back(MakeShape(kind,
                                  {place.x(), place.y(), half_size.z()},
                                  half_size,
                                  random_.Uniform(0.0, kPi),
                                  MakeTexture(HashKey({seed_, kTextureStream, shapes_.size()}))));
      return;
    }
  }

  RandomStream& random() { return random_; }

 private:
  struct Footprint {
    Eigen::Vector2d centre;
    double radius;
  };
  uint64_t seed_;
  RandomStream random_;
  std::vector<Shape>& shapes_;
  std::vector<Footprint> footprints_;
};

Eigen::Vector2d PlaceInMiddle(RandomStream& random) {
  const double angle_rad = random.Uniform(0.0, 2.0 * kPi);
  const double distance = kMiddleRadius * std::sqrt(random.Uniform());
  return {distance * std::cos(angle_rad), distance * std::sin(angle_rad)};
}

std::vector<Shape> MakeStaticShapes(const SyntheticOptions& options) {
  const double scale = DistanceScale(options);
  const Eigen::Vector3d room_half_size(
      scale * kRoomHalfSize, scale * kRoomHalfSize, kRoomHalfHeight);
  std::vector<Shape> shapes = {MakeShape(ShapeKind::kRoom,
                                         {0.0, 0.0, kRoomHalfHeight},
                                         room_half_size,
                                         0.0,
                                         MakeTexture(HashKey({options.seed, kTextureStream}),
                                                     {.max_saturation = 0.35, .hue_range = 0.5}))};
  Furnisher furnisher(options, shapes);
  RandomStream& random = furnisher.random();
  const auto place_along_wall = [scale](RandomStream& stream) -> Eigen::Vector2d {
    const double along = stream.Uniform(-6.5, 6.5) * scale;
    const double across = stream.Uniform(6.9, 7.3) * scale;
    switch (stream.Bits() % 4) {
      case 0:
        return {along, across};
      case 1:
        return {across, along};
      case 2:
        return {-across, along};
      default:
        // The cameras' side stays free for those that drive in.
        return {along < 0.0 ? along - 2.0 : along + 2.0, -across};
    }
  };
  for (int i = 0; i < 7; ++i) {
    const Eigen::Vector3d half_size{
        random.Uniform(0.2, 0.5), random.Uniform(0.2, 0.5), random.Uniform(0.25, 0.85)};
    furnisher.Add(ShapeKind::kBox, half_size, PlaceInMiddle);
  }
  for (int i = 0; i < 3; ++i) {
    const double radius = random.Uniform(0.25, 0.45);
    furnisher.Add(ShapeKind::kEllipsoid, Eigen::Vector3d::Constant(radius), PlaceInMiddle);
  }
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d half_size{
        random.Uniform(0.2, 0.6), random.Uniform(0.2, 0.6), random.Uniform(0.4, 1.5)};
    furnisher.Add(ShapeKind::kBox, half_size, place_along_wall);
  }
  return shapes;
}

// A mover's body in its own frame: x ahead, z up, origin on the floor.
struct BodyPart {
  ShapeKind kind;
  Eigen::Vector3d centre;
  Eigen::Vector3d half_size;
  int texture_idx;
};

std::vector<BodyPart> WalkerParts(double step) {
  const auto part = ShapeKind::kEllipsoid;
  return {{part, {0.0, 0.0, 1.62}, {0.11, 0.09, 0.14}, 0},
          {part, {0.0, 0.0, 1.18}, {0.14, 0.21, 0.34}, 1},
          {part, {0.15 * step, 0.11, 0.45}, {0.09, 0.09, 0.48}, 2},
          {part, {-0.15 * step, -0.11, 0.45}, {0.09, 0.09, 0.48}, 2},
          {part, {-0.10 * step, 0.24, 1.14}, {0.06, 0.06, 0.33}, 1},
          {part, {0.10 * step, -0.24, 1.14}, {0.06, 0.06, 0.33}, 1}};
}

std::vector<BodyPart> CartParts() {
  const auto wheel = ShapeKind::kEllipsoid;
  return {{ShapeKind::kBox, {0.0, 0.0, 0.62}, {0.55, 0.32, 0.42}, 0},
          {ShapeKind::kBox, {-0.15, 0.0, 1.24}, {0.34, 0.28, 0.20}, 1},
          {wheel, {0.36, 0.30, 0.16}, {0.16, 0.05, 0.16}, 2},
          {wheel, {0.36, -0.30, 0.16}, {0.16, 0.05, 0.16}, 2},
          {wheel, {-0.36, 0.30, 0.16}, {0.16, 0.05, 0.16}, 2},
          {wheel, {-0.36, -0.30, 0.16}, {0.16, 0.05, 0.16}, 2}};
}

struct MoverState {
  Eigen::Vector2d place;
  double yaw_rad;
  double step;  // swing of legs and arms, in [-1, 1]
};

// Movers keep near the camera's view and drift through it, as passers-by do: between neighbouring
// views their motion is rigid and smooth, and it contradicts the static scene.
MoverState FindMover(const SyntheticOptions& options, const View& view, int mover, int view_idx) {
  RandomStream random(HashKey({options.seed, kMoverStream, static_cast<uint64_t>(mover)}));
  const double phase = 2.0 * kPi * (mover + random.Uniform(0.0, 0.5)) / options.num_distractors;
  const double pace = (mover % 2 == 0 ? 1.0 : -1.0) * random.Uniform(0.25, 0.4);
  const double base_distance = random.Uniform(2.8, 3.4);
  const double first_yaw_rad = random.Uniform(0.0, 2.0 * kPi);
  const double yaw_rad = first_yaw_rad + random.Uniform(-0.12, 0.12) * view_idx;
  const double lateral = 0.8 * std::sin(phase + pace * view_idx);
  const double distance = (base_distance + 0.2 * std::cos(0.6 * view_idx + phase)) *
                          options.focal_length_factor / kDefaultFocalFactor;
  const double half_width =
      0.5 * options.width / (options.focal_length_factor * std::max(options.width, options.height));
  const Eigen::Matrix3d rotation = view.cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector2d right = rotation.row(0).head<2>().transpose().normalized();
  const Eigen::Vector2d ahead = rotation.row(2).head<2>().transpose().normalized();
  const Eigen::Vector2d centre = OriginInSource(view.cam_from_world).head<2>();
  return {centre + distance * (ahead + lateral * half_width * right),
          yaw_rad,
          std::sin(0.9 * view_idx + phase)};
}

void AddMover(const SyntheticOptions& options,
              const View& view,
              int mover,
              int view_idx,
              std::vector<Shape>& shapes) {
  const MoverState state = FindMover(options, view, mover, view_idx);
  const double size = options.distractor_size;
  const Eigen::Matrix3d world_from_body =
      Eigen::AngleAxisd(state.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d place(state.place.x(), state.place.y(), 0.0);
  constexpr double kTextureScale = 0.35;
  for (const BodyPart& part : mover % 4 == 2 ? CartParts() : WalkerParts(state.step)) {
    const uint64_t texture_key = HashKey({options.seed,
                                          kMoverTextureStream,
                                          static_cast<uint64_t>(mover),
                                          static_cast<uint64_t>(part.texture_idx)});
    shapes.push_back(MakeShape(part.kind,
                               place + size * (world_from_body * part.centre),
                               size * part.half_size,
                               state.yaw_rad,
                               MakeTexture(texture_key, {.scale = size * kTextureScale})));
  }
}

std::vector<Shape> MakeDistractors(const SyntheticOptions& options,
                                   const View& view,
                                   int view_idx) {
  std::vector<Shape> shapes;
  for (int mover = 0; mover < options.num_distractors; ++mover) {
    RandomStream random(HashKey({options.seed,
                                 kAbsenceStream,
                                 static_cast<uint64_t>(mover),
                                 static_cast<uint64_t>(view_idx)}));
    if (random.Uniform() < options.distractor_absence) continue;
    AddMover(options, view, mover, view_idx, shapes);
  }
  return shapes;
}

}  // namespace

SyntheticWorld MakeSyntheticWorld(const SyntheticOptions& options) {
  SyntheticWorld world;
  world.views = MakeViews(options);
  world.static_shapes = MakeStaticShapes(options);
  for (int i = 0; i < options.num_views; ++i) {
    world.distractor_shapes.push_back(
        MakeDistractors(options, world.views[static_cast<size_t>(i)], i));
  }
  return world;
}

std::optional<Ray> PixelRay(const View& view, const Eigen::Vector2d& pixel) {
  const auto ray_in_cam = Unproject(view.camera, pixel);
  if (!ray_in_cam) return std::nullopt;
  return Ray{OriginInSource(view.cam_from_world),
             view.cam_from_world.rotation.conjugate() * ray_in_cam->homogeneous()};
}

}  // namespace vgtw
