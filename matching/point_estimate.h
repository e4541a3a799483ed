// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// What one view says about a point: it lies on a ray, at a distance along it.
struct Sighting {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();         // of the camera; all in the world
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();          // of the camera
  Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();           // unit length
  double range = std::numeric_limits<double>::quiet_NaN();  // NaN = unknown
  double range_sigma = 0.0;                                 // relative, > 0
};

struct PointLimits {
  double ray_sigma_rad = 0.0;  // per axis, > 0
  double max_ray_rad = 0.0;    // whatever max_sigmas says
  double max_sigmas = 4.0;     // of errors that agree

  double RayRad() const;
};

struct PointEstimate {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  double sigma = 0.0;              // rms of the distance to the true point
  std::vector<size_t> agreeing;    // sightings whose rays agree, ascending, at least 2
  std::vector<double> errors_rad;  // of all sightings; infinite where the point is not in front
};

// The maximum-likelihood point under Tukey's robust loss on both kinds of errors, from the best of
// what single sightings and pairs with a range say. nullopt unless the rays of two and of half of
// all agree, with the point in front of them, and the ranges of more than half of those that have
// one.
std::optional<PointEstimate> EstimatePoint(std::span<const Sighting> sightings,
                                           const PointLimits& limits);

}  // namespace vgtw
