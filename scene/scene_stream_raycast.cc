// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_raycast.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

using Vector = std::array<float, 3>;

constexpr float kMinDepth = 1e-4f;
constexpr float kNothing = SolidInView::kNothing;

// std::min and std::max by reference keep the compiler from vectorising.
inline float Min(float a, float b) { return a < b ? a : b; }
inline float Max(float a, float b) { return a > b ? a : b; }

struct Interval {
  float entry;
  float exit;
};

// Of |origin + t * direction| <= 1. A zero direction is replaced by a tiny one.
inline Interval Slab(float origin, float direction) {
  constexpr float kTiny = 1e-12f;
  const float inverse = 1.0f / (std::abs(direction) < kTiny ? kTiny : direction);
  const float a = (-1.0f - origin) * inverse;
  const float b = (1.0f - origin) * inverse;
  return {Min(a, b), Max(a, b)};
}

inline Interval Box(const Vector& o, const Vector& d) {
  const Interval x = Slab(o[0], d[0]);
  const Interval y = Slab(o[1], d[1]);
  const Interval z = Slab(o[2], d[2]);
  return {Max(Max(x.entry, y.entry), z.entry), Min(Min(x.exit, y.exit), z.exit)};
}

// The unit ball by the ray's point nearest to its centre: b^2 - a c would lose half the digits.
// An empty interval is entry > exit.
inline Interval Ball(const Vector& o, const Vector& d) {
  const float inverse = 1.0f / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  const float t = -(o[0] * d[0] + o[1] * d[1] + o[2] * d[2]) * inverse;
  const float x = o[0] + t * d[0];
  const float y = o[1] + t * d[1];
  const float z = o[2] + t * d[2];
  const float rest = 1.0f - (x * x + y * y + z * z);
  const float half = std::sqrt(Max(rest, 0.0f) * inverse);
  return {rest < 0.0f ? kNothing : t - half, t + half};
}

inline Interval Cylinder(const Vector& o, const Vector& d) {
  const Interval caps = Slab(o[2], d[2]);
  const float inverse = 1.0f / Max(d[0] * d[0] + d[1] * d[1], 1e-20f);
  const float t = -(o[0] * d[0] + o[1] * d[1]) * inverse;
  const float x = o[0] + t * d[0];
  const float y = o[1] + t * d[1];
  const float rest = 1.0f - (x * x + y * y);
  const float half = std::sqrt(Max(rest, 0.0f) * inverse);
  return {rest < 0.0f ? kNothing : Max(caps.entry, t - half), Min(caps.exit, t + half)};
}

template <ShapeKind kind>
inline float Depth(const Vector& o, const Vector& d) {
  constexpr bool kFromInside = kind == ShapeKind::kRoom || kind == ShapeKind::kDome;
  Interval inside;
  if constexpr (kind == ShapeKind::kCylinder) {
    inside = Cylinder(o, d);
  } else if constexpr (kind == ShapeKind::kEllipsoid || kind == ShapeKind::kDome) {
    inside = Ball(o, d);
  } else {
    inside = Box(o, d);
  }
  const float depth = kFromInside ? inside.exit : inside.entry;
  return inside.entry <= inside.exit && depth >= kMinDepth ? depth : kNothing;
}

Vector ToUnitFrame(const Eigen::Vector3d& vector, const Solid& solid) {
  const Eigen::Vector3f v =
      (solid.local_from_world_rotation * vector).cwiseQuotient(solid.half_size).cast<float>();
  return {v.x(), v.y(), v.z()};
}

// Calls `use` with the kind as a constant.
template <typename Use>
auto WithKind(ShapeKind kind, const Use& use) {
  switch (kind) {
    case ShapeKind::kEllipsoid:
      return use.template operator()<ShapeKind::kEllipsoid>();
    case ShapeKind::kCylinder:
      return use.template operator()<ShapeKind::kCylinder>();
    case ShapeKind::kRoom:
      return use.template operator()<ShapeKind::kRoom>();
    case ShapeKind::kDome:
      return use.template operator()<ShapeKind::kDome>();
    case ShapeKind::kBox:
      break;
  }
  return use.template operator()<ShapeKind::kBox>();
}

}  // namespace

SolidInView::SolidInView(const Solid& solid, const Camera& camera, const Rigid3d& cam_from_world)
    : kind_(solid.kind),
      half_size_(solid.half_size.cast<float>().array()),
      world_from_local_rotation_(solid.local_from_world_rotation.transpose().cast<float>()) {
  VGTW_CHECK(camera.model == CameraModel::kPinhole, "the camera has another model than PINHOLE");
  const Eigen::Vector2d focal_length(camera.FocalLengthX(), camera.FocalLengthY());
  const Eigen::Vector2d principal_point = camera.PrincipalPoint();
  const Eigen::Matrix3d world_from_cam = cam_from_world.rotation.conjugate().toRotationMatrix();
  const Eigen::Vector3d at_zero(
      -principal_point.x() / focal_length.x(), -principal_point.y() / focal_length.y(), 1.0);
  origin_ = ToUnitFrame(OriginInSource(cam_from_world) - solid.centre_in_world, solid);
  direction_ = ToUnitFrame(world_from_cam * at_zero, solid);
  per_x_ = ToUnitFrame(world_from_cam.col(0) / focal_length.x(), solid);
  per_y_ = ToUnitFrame(world_from_cam.col(1) / focal_length.y(), solid);
  pixel_angle_ = static_cast<float>(1.0 / camera.MeanFocalLength());
  BoundPixels(solid, camera, cam_from_world);
}

// The pixels of the enclosing box's corners bound those of the solid, if all lie before the camera.
void SolidInView::BoundPixels(const Solid& solid,
                              const Camera& camera,
                              const Rigid3d& cam_from_world) {
  constexpr double kNear = 1e-3;
  Eigen::Array2d min_pixel = Eigen::Array2d::Constant(std::numeric_limits<double>::max());
  Eigen::Array2d max_pixel = -min_pixel;
  int num_behind = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d signs(
        corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0, corner & 4 ? 1.0 : -1.0);
    const Eigen::Vector3d point_in_cam =
        cam_from_world * (solid.centre_in_world + solid.local_from_world_rotation.transpose() *
                                                      signs.cwiseProduct(solid.half_size));
    if (point_in_cam.z() < kNear) {
      ++num_behind;
      continue;
    }
    const Eigen::Array2d pixel = *Project(camera, point_in_cam);
    min_pixel = min_pixel.min(pixel);
    max_pixel = max_pixel.max(pixel);
  }
  if (num_behind == 8) return;
  end_x_ = static_cast<int>(camera.width);
  end_y_ = static_cast<int>(camera.height);
  if (num_behind > 0) return;
  const Eigen::Array2d size(end_x_, end_y_);
  const Eigen::Array2i min = (min_pixel - 0.5).floor().max(0.0).min(size).cast<int>();
  const Eigen::Array2i end = (max_pixel + 0.5).ceil().max(0.0).min(size).cast<int>();
  min_x_ = min.x();
  min_y_ = min.y();
  end_x_ = end.x();
  end_y_ = end.y();
}

float SolidInView::DepthAt(float x, float y) const {
  const Vector direction = DirectionAt(x, y);
  return WithKind(kind_, [&]<ShapeKind kind>() { return Depth<kind>(origin_, direction); });
}

template <ShapeKind kind>
void SolidInView::CastRows(int32_t index, Grid<float>& depth, Grid<int32_t>& indices) const {
  const Vector origin = origin_;
  const Vector per_x = per_x_;
  for (int y = min_y_; y < end_y_; ++y) {
    const Vector row = DirectionAt(0.0f, static_cast<float>(y) + 0.5f);
    float* row_depth = &depth(0, y);
    int32_t* row_indices = &indices(0, y);
    for (int x = min_x_; x < end_x_; ++x) {
      const float px = static_cast<float>(x) + 0.5f;
      const Vector direction{
          row[0] + px * per_x[0], row[1] + px * per_x[1], row[2] + px * per_x[2]};
      const float here = Depth<kind>(origin, direction);
      const bool is_nearer = here < row_depth[x];
      row_depth[x] = is_nearer ? here : row_depth[x];
      row_indices[x] = is_nearer ? index : row_indices[x];
    }
  }
}

void SolidInView::Cast(int32_t index, Grid<float>& depth, Grid<int32_t>& indices) const {
  if (min_x_ >= end_x_ || min_y_ >= end_y_) return;
  WithKind(kind_, [&]<ShapeKind kind>() { CastRows<kind>(index, depth, indices); });
}

SurfaceSample SolidInView::Describe(float x, float y, float depth) const {
  const Vector direction = DirectionAt(x, y);
  Eigen::Array3f unit_point;
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<size_t>(i);
    unit_point[i] = origin_[k] + depth * direction[k];
  }
  SurfaceSample sample;
  int axis = 0;
  unit_point.abs().maxCoeff(&axis);
  sample.face = 2 * axis + (unit_point[axis] > 0.0f ? 1 : 0);
  sample.point_in_local = unit_point * half_size_;
  const bool is_ball = kind_ == ShapeKind::kEllipsoid || kind_ == ShapeKind::kDome;
  const bool is_mantle = kind_ == ShapeKind::kCylinder &&
                         unit_point.z() * unit_point.z() < unit_point.head<2>().square().sum();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  if (is_ball || is_mantle) {
    normal = unit_point / half_size_;
    if (is_mantle) normal.z() = 0.0f;
    normal.normalize();
  } else {
    normal[axis] = unit_point[axis] > 0.0f ? 1.0f : -1.0f;
  }
  if (kind_ == ShapeKind::kRoom || kind_ == ShapeKind::kDome) normal = -normal;
  const Eigen::Map<const Eigen::Array3f> direction_in_unit(direction.data());
  const Eigen::Vector3f direction_in_local = direction_in_unit * half_size_;
  const float cos_incidence = std::abs(normal.dot(direction_in_local)) / direction_in_local.norm();
  // On slanted surfaces the geometric mean of both directions: the shorter one would alias, the
  // longer one would blur all detail away.
  sample.footprint = pixel_angle_ * depth / std::sqrt(std::max(cos_incidence, 0.05f));
  sample.normal_in_world = world_from_local_rotation_ * normal;
  return sample;
}

std::vector<SolidInView> SeePieces(std::span<const Piece> pieces,
                                   const Camera& camera,
                                   const Rigid3d& cam_from_world) {
  std::vector<SolidInView> solids;
  solids.reserve(pieces.size());
  for (const Piece& piece : pieces) solids.emplace_back(piece.solid, camera, cam_from_world);
  return solids;
}

void CastInto(std::span<const SolidInView> solids, int32_t first_index, HitMap& hits) {
  for (const SolidInView& solid : solids) solid.Cast(first_index++, hits.depth, hits.index);
}

}  // namespace vgtw
