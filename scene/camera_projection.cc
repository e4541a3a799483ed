// SPDX-License-Identifier: BSD-3-Clause
// All of COLMAP's models 0..10 are special cases of one formula for a ray (u, v) = (x/z, y/z):
//   w = (u, v) * atan(t r) / (s r),  r = |(u, v)|     (w = (u, v) for the models without a bend)
//   d = w * (1 + a1 q + a2 q^2 + a3 q^3 + a4 q^4) / (1 + b1 q + b2 q^2 + b3 q^3),  q = |w|^2,
//     + (2 p1 wx wy + p2 (q + 2 wx^2) + sx q,  2 p2 wx wy + p1 (q + 2 wy^2) + sy q)
//   pixel = (fx dx + cx, fy dy + cy)
// The bend has t = s = 1 for fisheyes and t = 2 tan(omega / 2), s = omega for FOV.
#include "scene/camera.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace vgtw {
namespace {

struct Distortion {
  bool is_bent = false;
  double bend_t = 1.0;
  double bend_s = 1.0;
  bool is_distorted = false;
  std::array<double, 4> a = {};
  std::array<double, 3> b = {};
  double p1 = 0.0;
  double p2 = 0.0;
  double sx = 0.0;
  double sy = 0.0;
};

Distortion MakeDistortion(const Camera& camera) {
  Distortion d;
  const double* extra = camera.params.data() + camera.FirstExtraParamIdx();
  d.is_distorted = true;
  switch (camera.model) {
    case CameraModel::kSimplePinhole:
    case CameraModel::kPinhole:
      d.is_distorted = false;
      break;
    case CameraModel::kSimpleRadialFisheye:
      d.is_bent = true;
      [[fallthrough]];
    case CameraModel::kSimpleRadial:
      d.a[0] = extra[0];
      break;
    case CameraModel::kRadialFisheye:
      d.is_bent = true;
      [[fallthrough]];
    case CameraModel::kRadial:
      d.a = {extra[0], extra[1]};
      break;
    case CameraModel::kOpenCVFisheye:
      d.is_bent = true;
      d.a = {extra[0], extra[1], extra[2], extra[3]};
      break;
    case CameraModel::kThinPrismFisheye:
      d.is_bent = true;
      d.a = {extra[0], extra[1], extra[4], extra[5]};
      d.p1 = extra[2];
      d.p2 = extra[3];
      d.sx = extra[6];
      d.sy = extra[7];
      break;
    case CameraModel::kFullOpenCV:
      d.a[2] = extra[4];
      d.b = {extra[5], extra[6], extra[7]};
      [[fallthrough]];
    case CameraModel::kOpenCV:
      d.a[0] = extra[0];
      d.a[1] = extra[1];
      d.p1 = extra[2];
      d.p2 = extra[3];
      break;
    case CameraModel::kFOV:
      d.is_distorted = false;
      d.is_bent = extra[0] != 0.0;
      d.bend_s = extra[0];
      d.bend_t = 2.0 * std::tan(0.5 * extra[0]);
      break;
  }
  return d;
}

Eigen::Vector2d Bend(const Distortion& d, const Eigen::Vector2d& ray) {
  if (!d.is_bent) return ray;
  const double r = ray.norm();
  // Below this atan(x) / x is 1 to the last digit.
  constexpr double kMinAngle = 1e-9;
  if (std::abs(d.bend_t) * r < kMinAngle) return ray * (d.bend_t / d.bend_s);
  return ray * (std::atan(d.bend_t * r) / (d.bend_s * r));
}

std::optional<Eigen::Vector2d> Unbend(const Distortion& d, const Eigen::Vector2d& bent) {
  if (!d.is_bent) return bent;
  const double angle = std::abs(d.bend_s) * bent.norm();
  if (!(angle < 0.5 * std::numbers::pi)) return std::nullopt;
  constexpr double kMinAngle = 1e-9;
  if (angle < kMinAngle) return bent * (d.bend_s / d.bend_t);
  return bent * (std::tan(angle) / (std::abs(d.bend_t) * bent.norm()));
}

// The second line of the formula and, where asked for, its Jacobian.
Eigen::Vector2d Distort(const Distortion& d, const Eigen::Vector2d& w, Eigen::Matrix2d* jacobian) {
  const double q = w.squaredNorm();
  const double x = w.x();
  const double y = w.y();
  const double numerator = 1.0 + q * (d.a[0] + q * (d.a[1] + q * (d.a[2] + q * d.a[3])));
  const double denominator = 1.0 + q * (d.b[0] + q * (d.b[1] + q * d.b[2]));
  const double radial = numerator / denominator;
  const Eigen::Vector2d distorted(
      x * radial + 2.0 * d.p1 * x * y + d.p2 * (q + 2.0 * x * x) + d.sx * q,
      y * radial + 2.0 * d.p2 * x * y + d.p1 * (q + 2.0 * y * y) + d.sy * q);
  if (jacobian != nullptr) {
    const double numerator_dq = d.a[0] + q * (2.0 * d.a[1] + q * (3.0 * d.a[2] + q * 4.0 * d.a[3]));
    const double denominator_dq = d.b[0] + q * (2.0 * d.b[1] + q * 3.0 * d.b[2]);
    const double radial_dq = (numerator_dq - radial * denominator_dq) / denominator;
    *jacobian = 2.0 * radial_dq * w * w.transpose();
    jacobian->diagonal().array() += radial;
    *jacobian += 2.0 * Eigen::Vector2d(d.sx + d.p2, d.sy + d.p1) * w.transpose();
    (*jacobian)(0, 0) += 2.0 * d.p1 * y + 4.0 * d.p2 * x;
    (*jacobian)(0, 1) += 2.0 * d.p1 * x;
    (*jacobian)(1, 0) += 2.0 * d.p2 * y;
    (*jacobian)(1, 1) += 2.0 * d.p2 * x + 4.0 * d.p1 * y;
  }
  return distorted;
}

// Whether Distort keeps its orientation all the way from the optical axis to `w`. Behind a fold of
// the distortion the same pixel has a second, wrong preimage.
bool IsOnPrincipalBranch(const Distortion& d, const Eigen::Vector2d& w) {
  constexpr int kNumSteps = 16;
  Eigen::Matrix2d jacobian;
  for (int i = 1; i <= kNumSteps; ++i) {
    Distort(d, w * (static_cast<double>(i) / kNumSteps), &jacobian);
    if (!(jacobian.determinant() > 0.0)) return false;
  }
  return true;
}

// Newton's method with step halving, from the optical axis outwards.
std::optional<Eigen::Vector2d> Undistort(const Distortion& d,
                                         const Eigen::Vector2d& distorted,
                                         double max_residual) {
  if (!d.is_distorted) return distorted;
  constexpr int kMaxIterations = 50;
  constexpr int kMaxHalvings = 20;
  // Quadratic convergence makes the extra digits almost free; below rounding there are none.
  const double target_residual = std::max(
      1e-2 * max_residual, 4.0 * std::numeric_limits<double>::epsilon() * distorted.norm());
  Eigen::Vector2d w = Eigen::Vector2d::Zero();
  double residual_norm = distorted.norm();
  for (int i = 0; i < kMaxIterations && residual_norm > target_residual; ++i) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d residual = distorted - Distort(d, w, &jacobian);
    Eigen::Vector2d step = jacobian.inverse() * residual;
    bool is_better = false;
    for (int halving = 0; halving < kMaxHalvings && !is_better; ++halving, step *= 0.5) {
      const Eigen::Vector2d candidate = w + step;
      const double norm = (distorted - Distort(d, candidate, &jacobian)).norm();
      is_better = norm < residual_norm && jacobian.determinant() > 0.0;
      if (is_better) {
        w = candidate;
        residual_norm = norm;
      }
    }
    if (!is_better) break;
  }
  if (!(residual_norm <= max_residual) || !IsOnPrincipalBranch(d, w)) return std::nullopt;
  return w;
}

}  // namespace

std::optional<Eigen::Vector2d> Project(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  if (!(point_in_cam.z() > 0.0)) return std::nullopt;
  const Distortion d = MakeDistortion(camera);
  const Eigen::Vector2d distorted = Distort(d, Bend(d, point_in_cam.hnormalized()), nullptr);
  const Eigen::Vector2d focal_lengths(camera.FocalLengthX(), camera.FocalLengthY());
  const Eigen::Vector2d pixel = focal_lengths.cwiseProduct(distorted) + camera.PrincipalPoint();
  if (!pixel.allFinite()) return std::nullopt;
  return pixel;
}

std::optional<Eigen::Vector2d> Unproject(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d focal_lengths(camera.FocalLengthX(), camera.FocalLengthY());
  const Eigen::Vector2d distorted = (pixel - camera.PrincipalPoint()).cwiseQuotient(focal_lengths);
  if (!distorted.allFinite()) return std::nullopt;
  // Rounding alone moves far pixels by more than a fixed bound.
  const double max_residual = std::max(1e-10 / focal_lengths.maxCoeff(), 1e-14 * distorted.norm());
  const Distortion d = MakeDistortion(camera);
  const std::optional<Eigen::Vector2d> bent = Undistort(d, distorted, max_residual);
  if (!bent) return std::nullopt;
  const std::optional<Eigen::Vector2d> ray = Unbend(d, *bent);
  if (!ray || !ray->allFinite()) return std::nullopt;
  return ray;
}

}  // namespace vgtw
