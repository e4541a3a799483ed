// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pair_accuracy.h"

#include "evaluation/pose_alignment.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

namespace vgtw {
namespace {

// Share of the extent below which two centres give no direction.
constexpr double kMinRelativeBaseline = 1e-9;

constexpr double kWrong = std::numeric_limits<double>::infinity();

double AngleBetweenDirectionsDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

// Which of two opposite directions it is, is left open.
double Folded(double direction_deg) { return std::min(direction_deg, 180.0 - direction_deg); }

double ShareBelow(const std::vector<double>& errors_deg, double threshold_deg) {
  const auto num_below = std::count_if(
      errors_deg.begin(), errors_deg.end(), [&](double error) { return error < threshold_deg; });
  return static_cast<double>(num_below) / static_cast<double>(errors_deg.size());
}

}  // namespace

std::vector<PairError> ComputePairErrors(const std::vector<Rigid3d>& estimate,
                                         const std::vector<Rigid3d>& reference) {
  VGTW_CHECK(estimate.size() == reference.size(), "one pose of each view in both");
  const size_t n = estimate.size();
  const std::vector<Eigen::Vector3d> estimated_centres = CameraCentres(estimate);
  const std::vector<Eigen::Vector3d> expected_centres = CameraCentres(reference);
  const double min_estimated = kMinRelativeBaseline * Diameter(estimated_centres);
  const double min_expected = kMinRelativeBaseline * Diameter(expected_centres);
  std::vector<PairError> errors;
  errors.reserve(n * (n - std::min<size_t>(n, 1)) / 2);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = i + 1; j < n; ++j) {
      PairError error{i, j, 0.0, std::numeric_limits<double>::quiet_NaN()};
      error.rotation_deg =
          AngleBetweenDeg(estimate[j].rotation * estimate[i].rotation.conjugate(),
                          reference[j].rotation * reference[i].rotation.conjugate());
      const Eigen::Vector3d estimated = estimated_centres[j] - estimated_centres[i];
      const Eigen::Vector3d expected = expected_centres[j] - expected_centres[i];
      if (estimated.norm() > min_estimated && expected.norm() > min_expected) {
        // In the frame of camera 1 it does not depend on the world.
        error.direction_deg = AngleBetweenDirectionsDeg(estimate[i].rotation * estimated,
                                                        reference[i].rotation * expected);
      }
      errors.push_back(error);
    }
  }
  return errors;
}

PairAccuracy ComputePairAccuracy(const std::vector<PairError>& errors,
                                 int threshold_deg,
                                 size_t num_missing) {
  VGTW_CHECK(threshold_deg >= 1, "threshold_deg = " + std::to_string(threshold_deg));
  std::vector<double> rotations(num_missing, kWrong);
  std::vector<double> directions(num_missing, kWrong);
  std::vector<double> folded_maxima(num_missing, kWrong);
  std::vector<double> maxima(num_missing, kWrong);
  for (const PairError& error : errors) {
    const bool has_direction = !std::isnan(error.direction_deg);
    const double direction_deg = has_direction ? error.direction_deg : 0.0;
    rotations.push_back(error.rotation_deg);
    if (has_direction) directions.push_back(Folded(direction_deg));
    folded_maxima.push_back(std::max(error.rotation_deg, Folded(direction_deg)));
    maxima.push_back(std::max(error.rotation_deg, direction_deg));
  }
  return {.threshold_deg = static_cast<double>(threshold_deg),
          .rotation = ShareBelow(rotations, threshold_deg),
          .direction = ShareBelow(directions, threshold_deg),
          .auc_histogram = AucHistogram(folded_maxima, threshold_deg),
          .auc_trapezoid = AucTrapezoid(std::move(maxima), threshold_deg)};
}

double AucHistogram(const std::vector<double>& errors_deg, int threshold_deg) {
  double sum = 0.0;
  for (int edge = 1; edge < threshold_deg; ++edge) sum += ShareBelow(errors_deg, edge);
  // Of NumPy's histogram, which defines this one, the last bin includes its upper edge.
  sum += ShareBelow(errors_deg, std::nextafter(threshold_deg, kWrong));
  return sum / threshold_deg;
}

double AucTrapezoid(std::vector<double> errors_deg, double threshold_deg) {
  if (errors_deg.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(errors_deg.begin(), errors_deg.end());
  const double step = 1.0 / static_cast<double>(errors_deg.size());
  double area = 0.0;
  double recall = 0.0;
  double last_error = 0.0;
  for (const double error : errors_deg) {
    if (error > threshold_deg) break;
    area += (error - last_error) * (recall + 0.5 * step);
    recall += step;
    last_error = error;
  }
  return (area + (threshold_deg - last_error) * recall) / threshold_deg;
}

}  // namespace vgtw
