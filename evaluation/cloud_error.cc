// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/cloud_error.h"

#include "evaluation/point_tree.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

namespace vgtw {
namespace {

using Normals = std::vector<Eigen::Vector3d>;

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

void AddNormals(const Normals& of_points,
                const Normals& of_targets,
                const std::vector<Neighbour>& nearest,
                DirectedCloudError& error) {
  std::vector<double> cosines;
  cosines.reserve(nearest.size());
  for (size_t i = 0; i < nearest.size(); ++i) {
    const Eigen::Vector3d& normal = of_points[i];
    const Eigen::Vector3d& target = of_targets[nearest[i].idx];
    if (normal.isZero(0.0) || target.isZero(0.0)) continue;
    cosines.push_back(std::abs(normal.dot(target)));
  }
  error.num_normals = cosines.size();
  if (cosines.empty()) {
    error.normal_mean = error.normal_median = std::numeric_limits<double>::quiet_NaN();
    return;
  }
  error.normal_mean = Mean(cosines);
  error.normal_median = Median(std::move(cosines));
}

DirectedCloudError ErrorOf(const std::vector<Neighbour>& nearest,
                           const CloudErrorOptions& options) {
  DirectedCloudError error;
  error.num_points = nearest.size();
  std::vector<double> distances;
  distances.reserve(nearest.size());
  size_t num_within = 0;
  for (const Neighbour& neighbour : nearest) {
    double distance = std::sqrt(neighbour.squared_distance);
    num_within += distance < options.f_distance;
    if (options.clip_distance > 0.0 && distance > options.clip_distance) {
      distance = options.clip_distance;
      ++error.num_clipped;
    }
    distances.push_back(distance);
  }
  error.mean = Mean(distances);
  error.share_within_f_distance =
      static_cast<double>(num_within) / static_cast<double>(nearest.size());
  error.median = Median(std::move(distances));
  return error;
}

}  // namespace

void CloudErrorOptions::Check() const {
  VGTW_CHECK(num_normal_neighbours >= 3,
             "CloudErrorOptions::num_normal_neighbours = " + std::to_string(num_normal_neighbours) +
                 ", must be >= 3");
  VGTW_CHECK(std::isfinite(f_distance) && f_distance > 0.0,
             "CloudErrorOptions::f_distance = " + std::to_string(f_distance) + ", must be > 0");
  VGTW_CHECK(
      std::isfinite(clip_distance) && clip_distance >= 0.0,
      "CloudErrorOptions::clip_distance = " + std::to_string(clip_distance) + ", must be >= 0");
}

double CloudError::Overall() const { return 0.5 * (accuracy.mean + completeness.mean); }

double CloudError::NormalConsistencyMean() const {
  return 0.5 * (accuracy.normal_mean + completeness.normal_mean);
}

double CloudError::NormalConsistencyMedian() const {
  return 0.5 * (accuracy.normal_median + completeness.normal_median);
}

double CloudError::F() const {
  const double precision = accuracy.share_within_f_distance;
  const double recall = completeness.share_within_f_distance;
  return precision + recall > 0.0 ? 2.0 * precision * recall / (precision + recall) : 0.0;
}

CloudError CompareClouds(const std::vector<Eigen::Vector3d>& prediction,
                         const std::vector<Eigen::Vector3d>& reference,
                         const CloudErrorOptions& options) {
  options.Check();
  const PointTree prediction_tree(prediction, options.num_threads);
  const PointTree reference_tree(reference, options.num_threads);
  const std::vector<Neighbour> to_reference =
      reference_tree.NearestOfAll(prediction_tree, {}, options.num_threads);
  const std::vector<Neighbour> to_prediction =
      prediction_tree.NearestOfAll(reference_tree, {}, options.num_threads);
  CloudError error = {ErrorOf(to_reference, options), ErrorOf(to_prediction, options)};
  const auto k = static_cast<size_t>(options.num_normal_neighbours);
  const Normals prediction_normals = prediction_tree.Normals(k, options.num_threads);
  const Normals reference_normals = reference_tree.Normals(k, options.num_threads);
  AddNormals(prediction_normals, reference_normals, to_reference, error.accuracy);
  AddNormals(reference_normals, prediction_normals, to_prediction, error.completeness);
  return error;
}

}  // namespace vgtw
