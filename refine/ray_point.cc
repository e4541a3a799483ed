// SPDX-License-Identifier: BSD-3-Clause
#include "refine/ray_point.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace vgtw {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Pairs of up to so many rays are tried: when half of the rays are wrong, two right ones are among
// 8 in all but 1 of 28 cases.
constexpr size_t kMaxPairedRays = 8;
constexpr int kMaxIterations = 20;

using Rays = std::span<const PixelRay* const>;

std::optional<Eigen::Vector2d> TangentError(const PixelRay& ray, const Eigen::Vector3d& point) {
  const Eigen::Vector3d offset = point - ray.centre;
  const double along = ray.direction.dot(offset);
  if (!(along > 0.0 && ray.axis.dot(offset) > 0.0)) return std::nullopt;
  return ray.pixel_from_x * offset / along;
}

// Rays behind which the point lies count as if they were far off, so that fronts decide.
double RobustCost(Rays rays, const Eigen::Vector3d& point, double scale_px) {
  constexpr double kBehind = 1e4;  // in units of the scale
  double cost = 0.0;
  for (const PixelRay* ray : rays) {
    const double ratio = std::min(ErrorPx(*ray, point) / scale_px, kBehind);
    cost += std::log1p(ratio * ratio);
  }
  return cost;
}

// Least squares of the distances to the rays; every ray weighs the same.
std::optional<Eigen::Vector3d> Intersect(Rays rays) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (const PixelRay* ray : rays) {
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - ray->direction * ray->direction.transpose();
    information += across;
    moment += across * ray->centre;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(information);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return std::nullopt;
  const Eigen::Vector3d point = solver.solve(moment);
  if (!point.allFinite()) return std::nullopt;
  return point;
}

// One Gauss-Newton step with Cauchy's weights; nullopt where the rays leave a direction free.
std::optional<Eigen::Vector3d> Step(Rays rays, const Eigen::Vector3d& point, double scale_px) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (const PixelRay* ray : rays) {
    const auto error = TangentError(*ray, point);
    if (!error) continue;
    const double along = ray->direction.dot(point - ray->centre);
    const Eigen::Matrix<double, 2, 3> jacobian =
        (ray->pixel_from_x - *error * ray->direction.transpose()) / along;
    const double weight = 1.0 / (1.0 + error->squaredNorm() / (scale_px * scale_px));
    information += weight * jacobian.transpose() * jacobian;
    gradient += weight * jacobian.transpose() * *error;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(information);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return std::nullopt;
  const Eigen::Vector3d step = -solver.solve(gradient);
  if (!step.allFinite()) return std::nullopt;
  return step;
}

}  // namespace

std::optional<PixelRay> MakePixelRay(const Camera& camera,
                                     const Rigid3d& cam_from_world,
                                     const Eigen::Vector2d& pixel) {
  const auto uv = Unproject(camera, pixel);
  if (!uv) return std::nullopt;
  const Eigen::Vector3d direction = uv->homogeneous().normalized();
  // Differences of this size lose no more digits than the projection has to give.
  constexpr double kStep = 1e-5;
  Eigen::Matrix<double, 2, 3> pixel_from_x = Eigen::Matrix<double, 2, 3>::Zero();
  const Eigen::Vector3d side = direction.unitOrthogonal();
  for (const Eigen::Vector3d& across : {side, Eigen::Vector3d(direction.cross(side))}) {
    const auto before = Project(camera, direction - kStep * across);
    const auto after = Project(camera, direction + kStep * across);
    if (!before || !after) return std::nullopt;
    pixel_from_x += (*after - *before) / (2.0 * kStep) * across.transpose();
  }
  const Eigen::Matrix3d world_from_cam = cam_from_world.rotation.conjugate().toRotationMatrix();
  return PixelRay{OriginInSource(cam_from_world),
                  world_from_cam * direction,
                  world_from_cam.col(2),
                  pixel_from_x * world_from_cam.transpose()};
}

double ErrorPx(const PixelRay& ray, const Eigen::Vector3d& point) {
  const auto error = TangentError(ray, point);
  return error ? error->norm() : kInfinity;
}

std::optional<Eigen::Vector3d> EstimateRayPoint(Rays rays,
                                                double scale_px,
                                                const std::optional<Eigen::Vector3d>& start) {
  std::optional<Eigen::Vector3d> best;
  double best_cost = kInfinity;
  const auto consider = [&](const std::optional<Eigen::Vector3d>& point) {
    if (!point) return;
    const auto is_behind = [&](const PixelRay* ray) { return !TangentError(*ray, *point); };
    if (rays.size() - std::count_if(rays.begin(), rays.end(), is_behind) < 2) return;
    const double cost = RobustCost(rays, *point, scale_px);
    if (cost >= best_cost) return;
    best = point;
    best_cost = cost;
  };
  consider(start);
  consider(Intersect(rays));
  // Where every ray fits there is nothing that a pair could know better.
  const auto fits = [&](const PixelRay* ray) { return ErrorPx(*ray, *best) < scale_px; };
  if (rays.size() > 2 && !(best && std::all_of(rays.begin(), rays.end(), fits))) {
    const size_t num_paired = std::min(rays.size(), kMaxPairedRays);
    for (size_t i = 0; i < num_paired; ++i) {
      for (size_t k = 0; k < i; ++k) {
        const PixelRay* pair[] = {rays[k * rays.size() / num_paired],
                                  rays[i * rays.size() / num_paired]};
        consider(Intersect(pair));
      }
    }
  }
  for (int i = 0; best && i < kMaxIterations; ++i) {
    const auto step = Step(rays, *best, scale_px);
    if (!step) break;
    const Eigen::Vector3d point = *best + *step;
    const double cost = RobustCost(rays, point, scale_px);
    if (!(cost < best_cost)) break;
    const bool is_done = best_cost - cost < 1e-9 * best_cost;
    best = point;
    best_cost = cost;
    if (is_done) break;
  }
  return best;
}

}  // namespace vgtw
