// SPDX-License-Identifier: BSD-3-Clause
#include "matching/point_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace vgtw {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Error {
  double ray_rad = kInfinity;  // also where the point is not in front
  double range = kInfinity;    // |log|; NaN = unknown
};

Error ErrorOf(const Sighting& sighting, const Eigen::Vector3d& point) {
  const Eigen::Vector3d offset = point - sighting.centre;
  const double range = sighting.ray.dot(offset);
  const double z = sighting.axis.dot(offset);
  if (!(range > 0.0 && z > 0.0)) return {};
  return {std::atan2((offset - range * sighting.ray).norm(), range),
          std::abs(std::log(range / sighting.range))};
}

// Tukey's weight: 1 at no error, 0 from the limit on.
double RobustWeight(double error, double limit) {
  const double ratio = std::min(error / limit, 1.0);
  const double root = 1.0 - ratio * ratio;
  return root * root;
}

// Sum of the squared errors in units of their limits, each at most 1.
double RobustCost(std::span<const Sighting> sightings,
                  const Eigen::Vector3d& point,
                  const PointLimits& limits) {
  double cost = 0.0;
  const auto add = [&](double error, double limit) {
    const double ratio = std::min(error / limit, 1.0);
    cost += ratio * ratio;
  };
  for (const Sighting& sighting : sightings) {
    const Error error = ErrorOf(sighting, point);
    add(error.ray_rad, limits.RayRad());
    if (!std::isnan(sighting.range)) add(error.range, limits.max_sigmas * sighting.range_sigma);
  }
  return cost;
}

// Normal equations of the point:  information * point = moment.
struct NormalEquations {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double squared_error = 0.0;  // weighted, in sigmas, at the point that gave the weights
  double num_equations = 0.0;  // weighted

  // `range` is the distance at which the ray's angle counts.
  void Add(const Sighting& sighting,
           double range,
           double ray_sigma_rad,
           double ray_weight,
           double range_weight) {
    const Eigen::Matrix3d along = sighting.ray * sighting.ray.transpose();
    const double sigma_across = range * ray_sigma_rad;
    const Eigen::Matrix3d across =
        ray_weight / (sigma_across * sigma_across) * (Eigen::Matrix3d::Identity() - along);
    information += across;
    moment += across * sighting.centre;
    if (range_weight == 0.0) return;
    const double sigma_along = sighting.range * sighting.range_sigma;
    const Eigen::Matrix3d weighted = range_weight / (sigma_along * sigma_along) * along;
    information += weighted;
    moment += weighted * (sighting.centre + sighting.range * sighting.ray);
  }

  std::optional<Eigen::Vector3d> Point() const {
    const Eigen::LDLT<Eigen::Matrix3d> solver(information);
    if (solver.info() != Eigen::Success || !solver.isPositive()) return std::nullopt;
    const Eigen::Vector3d point = solver.solve(moment);
    if (!point.allFinite()) return std::nullopt;
    return point;
  }
};

Eigen::Vector3d Lift(const Sighting& sighting) {
  return sighting.centre + sighting.range * sighting.ray;
}

// What two views say together, of which the first has a depth.
std::optional<Eigen::Vector3d> LiftPair(const Sighting& a,
                                        const Sighting& b,
                                        const PointLimits& limits) {
  const bool has_range = !std::isnan(b.range);
  const double range_in_b = has_range ? b.range : (Lift(a) - b.centre).norm();
  NormalEquations equations;
  equations.Add(a, a.range, limits.ray_sigma_rad, 1.0, 1.0);
  equations.Add(b, range_in_b, limits.ray_sigma_rad, 1.0, has_range ? 1.0 : 0.0);
  return equations.Point();
}

// Spread evenly over the sightings with a range, or over those without.
std::vector<const Sighting*> Choose(std::span<const Sighting> sightings,
                                    bool with_range,
                                    size_t max_num) {
  std::vector<const Sighting*> all;
  for (const Sighting& sighting : sightings) {
    if (std::isnan(sighting.range) != with_range) all.push_back(&sighting);
  }
  if (all.size() <= max_num) return all;
  std::vector<const Sighting*> chosen;
  for (size_t i = 0; i < max_num; ++i) chosen.push_back(all[i * all.size() / max_num]);
  return chosen;
}

std::optional<Eigen::Vector3d> FindStart(std::span<const Sighting> sightings,
                                         const PointLimits& limits) {
  // When half of the views are bad, two good ones are among them in all but 1 of 9 cases.
  constexpr size_t kMaxViews = 6;
  const std::vector<const Sighting*> with_range = Choose(sightings, true, kMaxViews);
  const std::vector<const Sighting*> without_range = Choose(sightings, false, kMaxViews / 2);
  std::optional<Eigen::Vector3d> best;
  double best_cost = kInfinity;
  const auto consider = [&](const std::optional<Eigen::Vector3d>& point) {
    if (!point) return;
    const double cost = RobustCost(sightings, *point, limits);
    if (cost >= best_cost) return;
    best = point;
    best_cost = cost;
  };
  for (size_t i = 0; i < with_range.size(); ++i) {
    consider(Lift(*with_range[i]));
    for (size_t k = 0; k < i; ++k) consider(LiftPair(*with_range[k], *with_range[i], limits));
    for (const Sighting* other : without_range) {
      consider(LiftPair(*with_range[i], *other, limits));
    }
  }
  return best;
}

NormalEquations EquationsAround(std::span<const Sighting> sightings,
                                const Eigen::Vector3d& point,
                                const PointLimits& limits) {
  NormalEquations equations;
  for (const Sighting& sighting : sightings) {
    const Error error = ErrorOf(sighting, point);
    const double ray_weight = RobustWeight(error.ray_rad, limits.RayRad());
    if (ray_weight == 0.0) continue;
    // The depth of a view that looks elsewhere is that of something else.
    const double range_weight =
        std::isnan(sighting.range)
            ? 0.0
            : RobustWeight(error.range, limits.max_sigmas * sighting.range_sigma);
    const double range = sighting.ray.dot(point - sighting.centre);
    equations.Add(sighting, range, limits.ray_sigma_rad, ray_weight, range_weight);
    const auto add_error = [&](double weight, double sigmas, double num_equations) {
      equations.squared_error += weight * sigmas * sigmas;
      equations.num_equations += weight * num_equations;
    };
    add_error(ray_weight, error.ray_rad / limits.ray_sigma_rad, 2.0);
    if (range_weight > 0.0) add_error(range_weight, error.range / sighting.range_sigma, 1.0);
  }
  return equations;
}

// The agreeing part of the track; nullopt if it is too small.
std::optional<PointEstimate> Judge(std::span<const Sighting> sightings,
                                   const Eigen::Vector3d& point,
                                   const PointLimits& limits) {
  PointEstimate result;
  result.xyz = point;
  int num_ranges = 0;
  int num_agreeing_ranges = 0;
  for (size_t i = 0; i < sightings.size(); ++i) {
    const Sighting& sighting = sightings[i];
    const Error error = ErrorOf(sighting, point);
    const bool agrees = error.ray_rad <= limits.RayRad();
    result.errors_rad.push_back(error.ray_rad);
    num_ranges += !std::isnan(sighting.range);
    num_agreeing_ranges += agrees && error.range <= limits.max_sigmas * sighting.range_sigma;
    if (!agrees) continue;
    result.agreeing.push_back(i);
  }
  if (result.agreeing.size() < 2 || 2 * result.agreeing.size() < sightings.size()) {
    return std::nullopt;
  }
  if (2 * num_agreeing_ranges <= num_ranges) return std::nullopt;
  const NormalEquations equations = EquationsAround(sightings, point, limits);
  const double misfit = equations.squared_error / std::max(1.0, equations.num_equations - 3.0);
  result.sigma =
      std::sqrt(std::max(1.0, misfit) * Eigen::Matrix3d(equations.information.inverse()).trace());
  if (!std::isfinite(result.sigma)) return std::nullopt;
  return result;
}

}  // namespace

double PointLimits::RayRad() const { return std::min(max_sigmas * ray_sigma_rad, max_ray_rad); }

std::optional<PointEstimate> EstimatePoint(std::span<const Sighting> sightings,
                                           const PointLimits& limits) {
  std::optional<Eigen::Vector3d> point = FindStart(sightings, limits);
  if (!point) return std::nullopt;
  constexpr int kMaxIterations = 20;
  constexpr double kConverged = 1e-9;  // relative
  for (int i = 0; i < kMaxIterations; ++i) {
    const auto next = EquationsAround(sightings, *point, limits).Point();
    if (!next) return std::nullopt;
    const double change = (*next - *point).norm();
    const double distance = (*next - sightings.front().centre).norm();
    point = next;
    if (change <= kConverged * distance) break;
  }
  return Judge(sightings, *point, limits);
}

}  // namespace vgtw
