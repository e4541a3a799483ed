// SPDX-License-Identifier: BSD-3-Clause
#include "scene/sim3d.h"

#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace vgtw {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr size_t kSampleSize = 3;

void CheckPairs(const Points& points_in_a, const Points& points_in_b) {
  VGTW_CHECK(points_in_a.size() == points_in_b.size(), "points come in pairs");
  const auto is_finite = [](const Eigen::Vector3d& point) { return point.allFinite(); };
  VGTW_CHECK(std::all_of(points_in_a.begin(), points_in_a.end(), is_finite) &&
                 std::all_of(points_in_b.begin(), points_in_b.end(), is_finite),
             "points are finite");
}

// Weighted sums of two point patterns about their weighted means.
struct Moments {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_b = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_b_a = Eigen::Matrix3d::Zero();
  double variance_a = 0.0;
};

// `weight_of(i)` >= 0 with a positive sum.
template <typename WeightOf>
Moments ComputeMoments(const Points& points_in_a,
                       const Points& points_in_b,
                       const WeightOf& weight_of) {
  Moments moments;
  double weight_sum = 0.0;
  for (size_t i = 0; i < points_in_a.size(); ++i) {
    weight_sum += weight_of(i);
    moments.mean_a += weight_of(i) * points_in_a[i];
    moments.mean_b += weight_of(i) * points_in_b[i];
  }
  moments.mean_a /= weight_sum;
  moments.mean_b /= weight_sum;
  for (size_t i = 0; i < points_in_a.size(); ++i) {
    const double weight = weight_of(i) / weight_sum;
    const Eigen::Vector3d a = points_in_a[i] - moments.mean_a;
    moments.covariance_b_a += weight * (points_in_b[i] - moments.mean_b) * a.transpose();
    moments.variance_a += weight * a.squaredNorm();
  }
  return moments;
}

template <typename WeightOf>
std::optional<Sim3d> Estimate(const Points& points_in_a,
                              const Points& points_in_b,
                              bool fixed_scale,
                              const WeightOf& weight_of) {
  size_t num_weighted = 0;
  for (size_t i = 0; i < points_in_a.size(); ++i) num_weighted += weight_of(i) > 0.0;
  if (num_weighted < kSampleSize) return std::nullopt;
  const Moments moments = ComputeMoments(points_in_a, points_in_b, weight_of);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments.covariance_b_a,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  // Rounding of collinear points leaves a second singular value of about 1e-16 of the first.
  constexpr double kMinSingularRatio = 1e-12;
  if (!(svd.singularValues()[1] > kMinSingularRatio * svd.singularValues()[0])) return std::nullopt;
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) signs.z() = -1.0;
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  Sim3d b_from_a;
  b_from_a.rotation = Eigen::Quaterniond(rotation).normalized();
  // The best rotation is the same for every scale.
  b_from_a.scale = fixed_scale ? 1.0 : svd.singularValues().dot(signs) / moments.variance_a;
  if (!std::isnormal(b_from_a.scale) || b_from_a.scale < 0.0) return std::nullopt;
  b_from_a.translation = moments.mean_b - b_from_a.scale * (b_from_a.rotation * moments.mean_a);
  return b_from_a;
}

std::optional<Sim3d> EstimateFrom(const Points& points_in_a,
                                  const Points& points_in_b,
                                  bool fixed_scale,
                                  const std::vector<bool>& is_inlier) {
  return Estimate(
      points_in_a, points_in_b, fixed_scale, [&](size_t i) { return is_inlier[i] ? 1.0 : 0.0; });
}

// Calls visit(indices) for every sample of three, or for `max_samples` random ones if there are
// more.
template <typename Visit>
void ForEachSample(size_t n, size_t max_samples, uint64_t seed, const Visit& visit) {
  // In double, as the number of triples of 4e6 pairs does not fit 64 bits.
  const double num_triples = static_cast<double>(n) * (n - 1.0) * (n - 2.0) / 6.0;
  if (num_triples <= static_cast<double>(max_samples)) {
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = i + 1; j < n; ++j) {
        for (size_t k = j + 1; k < n; ++k) visit(std::array<size_t, kSampleSize>{i, j, k});
      }
    }
    return;
  }
  std::mt19937_64 random(seed);
  for (size_t sample = 0; sample < max_samples; ++sample) {
    const size_t i = random() % n;
    size_t j = random() % n;
    while (j == i) j = random() % n;
    size_t k = random() % n;
    while (k == i || k == j) k = random() % n;
    visit(std::array<size_t, kSampleSize>{i, j, k});
  }
}

void ComputeResiduals(const Sim3d& b_from_a,
                      const Points& points_in_a,
                      const Points& points_in_b,
                      std::vector<double>& residuals) {
  residuals.resize(points_in_a.size());
  for (size_t i = 0; i < points_in_a.size(); ++i) {
    residuals[i] = (points_in_b[i] - b_from_a * points_in_a[i]).norm();
  }
}

// Lower is better: the sum of squares, each at most that of the threshold, or the median.
double Cost(const std::vector<double>& residuals, double max_residual) {
  if (max_residual == 0.0) return Median(residuals);
  double cost = 0.0;
  for (const double residual : residuals) {
    const double capped = std::min(residual, max_residual);
    cost += capped * capped;
  }
  return cost;
}

// Half the pairs of exact data have residuals of rounding size; the median alone would then tell
// rounding from rounding. This floor is far above it and far below any measured scene.
double RoundingFloor(const Points& points_in_b) {
  constexpr double kRelativeFloor = 1e-9;
  std::vector<double> distances;
  for (const Eigen::Vector3d& point : points_in_b) distances.push_back(point.norm());
  return kRelativeFloor * Median(std::move(distances));
}

double ThresholdFromMedian(double median_residual, size_t n, double floor) {
  // Rousseeuw and Leroy: scale of the least median of squares with its small-sample factor.
  constexpr double kNormalScale = 1.4826;
  const double num_free = std::max(1.0, static_cast<double>(n) - kSampleSize);
  return std::max(floor, 2.5 * kNormalScale * (1.0 + 5.0 / num_free) * median_residual);
}

std::vector<bool> FindInliers(const std::vector<double>& residuals, double max_residual) {
  std::vector<bool> is_inlier(residuals.size());
  for (size_t i = 0; i < residuals.size(); ++i) is_inlier[i] = residuals[i] <= max_residual;
  return is_inlier;
}

}  // namespace

Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return {c_from_b.scale * b_from_a.scale,
          (c_from_b.rotation * b_from_a.rotation).normalized(),
          c_from_b * b_from_a.translation};
}

Sim3d Inverse(const Sim3d& b_from_a) {
  const Eigen::Quaterniond inverse = b_from_a.rotation.conjugate();
  return {1.0 / b_from_a.scale, inverse, -(inverse * b_from_a.translation) / b_from_a.scale};
}

Rigid3d TransformCamera(const Sim3d& b_from_a, const Rigid3d& cam_from_a) {
  const Eigen::Quaterniond cam_from_b =
      (cam_from_a.rotation * b_from_a.rotation.conjugate()).normalized();
  const Eigen::Vector3d centre_in_b = b_from_a * OriginInSource(cam_from_a);
  return {cam_from_b, -(cam_from_b * centre_in_b)};
}

std::optional<Sim3d> EstimateSim3d(const Points& points_in_a,
                                   const Points& points_in_b,
                                   const std::vector<double>& weights,
                                   bool fixed_scale) {
  CheckPairs(points_in_a, points_in_b);
  VGTW_CHECK(weights.empty() || weights.size() == points_in_a.size(), "one weight per pair");
  VGTW_CHECK(std::all_of(weights.begin(),
                         weights.end(),
                         [](double weight) { return std::isfinite(weight) && weight >= 0.0; }),
             "weights are finite and not negative");
  return Estimate(points_in_a, points_in_b, fixed_scale, [&](size_t i) {
    return weights.empty() ? 1.0 : weights[i];
  });
}

void RobustSim3dOptions::Check() const {
  VGTW_CHECK(
      std::isfinite(max_residual) && max_residual >= 0.0,
      "RobustSim3dOptions::max_residual = " + std::to_string(max_residual) + ", must be >= 0");
  VGTW_CHECK(
      max_iterations > 0,
      "RobustSim3dOptions::max_iterations = " + std::to_string(max_iterations) + ", must be > 0");
}

std::optional<RobustSim3d> EstimateSim3dRobust(const Points& points_in_a,
                                               const Points& points_in_b,
                                               const RobustSim3dOptions& options) {
  options.Check();
  CheckPairs(points_in_a, points_in_b);
  const size_t n = points_in_a.size();
  if (n < kSampleSize) return std::nullopt;
  RobustSim3d best;
  double best_cost = std::numeric_limits<double>::infinity();
  std::vector<double> residuals;
  ForEachSample(n, static_cast<size_t>(options.max_iterations), options.seed, [&](const auto& idx) {
    const std::optional<Sim3d> b_from_a =
        EstimateSim3d({points_in_a[idx[0]], points_in_a[idx[1]], points_in_a[idx[2]]},
                      {points_in_b[idx[0]], points_in_b[idx[1]], points_in_b[idx[2]]},
                      /*weights=*/{},
                      options.fixed_scale);
    if (!b_from_a) return;
    ComputeResiduals(*b_from_a, points_in_a, points_in_b, residuals);
    const double cost = Cost(residuals, options.max_residual);
    if (cost >= best_cost) return;
    best_cost = cost;
    best.b_from_a = *b_from_a;
  });
  if (!std::isfinite(best_cost)) return std::nullopt;
  best.max_residual = options.max_residual > 0.0
                          ? options.max_residual
                          : ThresholdFromMedian(best_cost, n, RoundingFloor(points_in_b));
  constexpr int kMaxRefits = 20;
  for (int refit = 0; refit < kMaxRefits; ++refit) {
    ComputeResiduals(best.b_from_a, points_in_a, points_in_b, residuals);
    std::vector<bool> is_inlier = FindInliers(residuals, best.max_residual);
    if (is_inlier == best.is_inlier) break;
    const std::optional<Sim3d> b_from_a =
        EstimateFrom(points_in_a, points_in_b, options.fixed_scale, is_inlier);
    if (!b_from_a) return std::nullopt;
    best.b_from_a = *b_from_a;
    best.is_inlier = std::move(is_inlier);
  }
  return best;
}

}  // namespace vgtw
