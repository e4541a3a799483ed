// SPDX-License-Identifier: BSD-3-Clause
#include "scene/pinhole_fit.h"

#include "scene/statistics.h"

#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

namespace vgtw {
namespace {

struct Observation {
  Eigen::Vector2d ray;  // (x / z, y / z)
  Eigen::Vector2d pixel;
  double weight = 0.0;
};

std::vector<Observation> Observe(const Grid<Eigen::Vector3f>& points,
                                 const ConfidenceMap& weights) {
  std::vector<Observation> observations;
  observations.reserve(points.size());
  for (int y = 0; y < points.height(); ++y) {
    for (int x = 0; x < points.width(); ++x) {
      const Eigen::Vector3d point = points(x, y).cast<double>();
      const double weight = weights.empty() ? 1.0 : static_cast<double>(weights(x, y));
      const bool counts =
          point.allFinite() && point.z() > 0.0 && std::isfinite(weight) && weight > 0.0;
      if (!counts) continue;
      observations.push_back({point.hnormalized(), {x + 0.5, y + 0.5}, weight});
    }
  }
  return observations;
}

struct Line {
  double slope = 0.0;
  double offset = 0.0;
};

// pixel = slope * ray + offset on one axis, around the weighted means.
Line FitLine(const std::vector<Observation>& observations, int axis) {
  double total = 0.0;
  double mean_ray = 0.0;
  double mean_pixel = 0.0;
  for (const Observation& o : observations) {
    total += o.weight;
    mean_ray += o.weight * o.ray[axis];
    mean_pixel += o.weight * o.pixel[axis];
  }
  mean_ray /= total;
  mean_pixel /= total;
  double covariance = 0.0;
  double variance = 0.0;
  for (const Observation& o : observations) {
    const double ray = o.ray[axis] - mean_ray;
    covariance += o.weight * ray * (o.pixel[axis] - mean_pixel);
    variance += o.weight * ray * ray;
  }
  const double slope = covariance / variance;
  return {slope, mean_pixel - slope * mean_ray};
}

}  // namespace

std::optional<PinholeFit> FitPinhole(const Grid<Eigen::Vector3f>& points_in_cam,
                                     const ConfidenceMap& weights) {
  constexpr size_t kMinObservations = 16;
  VGTW_CHECK(weights.empty() || (weights.width() == points_in_cam.width() &&
                                 weights.height() == points_in_cam.height()),
             "one weight per point");
  const std::vector<Observation> observations = Observe(points_in_cam, weights);
  if (observations.size() < kMinObservations) return std::nullopt;
  const Line u = FitLine(observations, 0);
  const Line v = FitLine(observations, 1);
  PinholeFit fit;
  fit.intrinsics << u.slope, 0.0, u.offset, 0.0, v.slope, v.offset, 0.0, 0.0, 1.0;
  if (!fit.intrinsics.allFinite() || u.slope <= 0.0 || v.slope <= 0.0) return std::nullopt;
  std::vector<double> errors;
  errors.reserve(observations.size());
  for (const Observation& o : observations) {
    const Eigen::Vector2d pixel(u.slope * o.ray.x() + u.offset, v.slope * o.ray.y() + v.offset);
    errors.push_back((pixel - o.pixel).norm());
  }
  fit.median_error_px = Median(std::move(errors));
  return fit;
}

}  // namespace vgtw
