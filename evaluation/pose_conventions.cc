// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_conventions.h"

#include "evaluation/pair_accuracy.h"
#include "evaluation/pose_alignment.h"
#include "scene/rigid3d.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include <Eigen/Core>

namespace vgtw {
namespace {

constexpr double kMinErrorDeg = 5.0;
constexpr double kMinRatio = 4.0;
// How much better a reading must be than one with fewer mistakes: relative, and beyond rounding.
constexpr double kPlainerRatio = 1.2;
constexpr double kRoundingDeg = 0.01;
constexpr size_t kMinViews = 2;
constexpr size_t kMaxViews = 64;
constexpr size_t kMinShuffledViews = 4;
constexpr size_t kMaxShuffledViews = 1000;
constexpr size_t kNumAnchors = 8;
constexpr size_t kNumJudges = 24;

struct CommonPoses {
  std::vector<std::string> names;
  std::vector<Rigid3d> estimate;
  std::vector<Rigid3d> reference;
};

// In the reference's order; `max_views` of them, evenly.
CommonPoses FindCommonPoses(const std::vector<NamedPose>& estimate,
                            const std::vector<NamedPose>& reference,
                            size_t max_views) {
  std::map<std::string, const Rigid3d*> estimate_by_name;
  for (const NamedPose& pose : estimate) estimate_by_name[pose.name] = &pose.cam_from_world;
  CommonPoses all;
  for (const NamedPose& pose : reference) {
    const auto found = estimate_by_name.find(pose.name);
    if (found == estimate_by_name.end()) continue;
    all.names.push_back(pose.name);
    all.estimate.push_back(*found->second);
    all.reference.push_back(pose.cam_from_world);
  }
  const size_t num_views = all.names.size();
  if (num_views <= max_views) return all;
  CommonPoses some;
  for (size_t i = 0; i < max_views; ++i) {
    const size_t idx = i * num_views / max_views;
    some.names.push_back(all.names[idx]);
    some.estimate.push_back(all.estimate[idx]);
    some.reference.push_back(all.reference[idx]);
  }
  return some;
}

// At least two views.
double MedianErrorDeg(const std::vector<Rigid3d>& estimate, const std::vector<Rigid3d>& reference) {
  std::vector<double> errors_deg;
  for (const PairError& pair : ComputePairErrors(estimate, reference)) {
    // std::fmax ignores the NaN of a pair without direction.
    errors_deg.push_back(std::fmax(pair.rotation_deg, pair.direction_deg));
  }
  return Median(std::move(errors_deg));
}

bool IsFarBetter(double error_deg, double error_as_read_deg) {
  return error_as_read_deg >= kMinErrorDeg && error_deg * kMinRatio <= error_as_read_deg;
}

// Centred camera centres of unit RMS radius: the names play no part in it.
std::vector<Eigen::Vector3d> NormalisedCentres(const std::vector<Rigid3d>& cams_from_world) {
  std::vector<Eigen::Vector3d> centres = CameraCentres(cams_from_world);
  const auto num_views = static_cast<double>(centres.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& centre : centres) mean += centre / num_views;
  double mean_squared = 0.0;
  for (Eigen::Vector3d& centre : centres) {
    centre -= mean;
    mean_squared += centre.squaredNorm() / num_views;
  }
  const double radius = std::sqrt(mean_squared);
  for (Eigen::Vector3d& centre : centres) centre /= std::max(radius, 1e-300);
  return centres;
}

// Finds which pose of the estimate is which of the reference.
class PoseAssigner {
 public:
  PoseAssigner(const std::vector<Rigid3d>& estimate, const std::vector<Rigid3d>& reference)
      : estimate_(estimate),
        reference_(reference),
        estimate_centres_(NormalisedCentres(estimate)),
        reference_centres_(NormalisedCentres(reference)) {}

  // For each of the reference's views the index of the estimate's pose.
  std::vector<size_t> Assign() const { return Assign(FindRotation()); }

 private:
  size_t size() const { return estimate_.size(); }

  // Squared radians plus squared radii.
  double Cost(const Eigen::Quaterniond& reference_from_estimate,
              const Eigen::Vector3d& rotated_estimate_centre,
              size_t estimate_idx,
              size_t reference_idx) const {
    const Eigen::Quaterniond expected =
        reference_[reference_idx].rotation * reference_from_estimate;
    const double cosine = std::abs(expected.dot(estimate_[estimate_idx].rotation));
    const double angle_rad = 2.0 * std::acos(std::min(1.0, cosine));
    return angle_rad * angle_rad +
           (rotated_estimate_centre - reference_centres_[reference_idx]).squaredNorm();
  }

  std::vector<Eigen::Vector3d> Rotated(const Eigen::Quaterniond& reference_from_estimate) const {
    std::vector<Eigen::Vector3d> centres;
    const Eigen::Matrix3d rotation = reference_from_estimate.toRotationMatrix();
    for (const Eigen::Vector3d& centre : estimate_centres_) centres.push_back(rotation * centre);
    return centres;
  }

  // Median over some views of the reference of the cost of the best pose of the estimate.
  double Judge(const Eigen::Quaterniond& reference_from_estimate) const {
    const std::vector<Eigen::Vector3d> centres = Rotated(reference_from_estimate);
    const size_t num_judges = std::min(kNumJudges, size());
    std::vector<double> costs;
    for (size_t judge = 0; judge < num_judges; ++judge) {
      const size_t reference_idx = judge * size() / num_judges;
      double best = std::numeric_limits<double>::infinity();
      for (size_t i = 0; i < size(); ++i) {
        best = std::min(best, Cost(reference_from_estimate, centres[i], i, reference_idx));
      }
      costs.push_back(best);
    }
    return Median(std::move(costs));
  }

  // The rotation between the worlds, from the best guess which pose some view's is.
  Eigen::Quaterniond FindRotation() const {
    Eigen::Quaterniond best = Eigen::Quaterniond::Identity();
    double best_cost = std::numeric_limits<double>::infinity();
    const size_t num_anchors = std::min(kNumAnchors, size());
    for (size_t anchor = 0; anchor < num_anchors; ++anchor) {
      const size_t reference_idx = anchor * size() / num_anchors;
      for (const Rigid3d& pose : estimate_) {
        const Eigen::Quaterniond rotation =
            reference_[reference_idx].rotation.conjugate() * pose.rotation;
        const double cost = Judge(rotation);
        if (cost >= best_cost) continue;
        best_cost = cost;
        best = rotation;
      }
    }
    return best;
  }

  // Greedily, the surest first.
  std::vector<size_t> Assign(const Eigen::Quaterniond& reference_from_estimate) const {
    const std::vector<Eigen::Vector3d> centres = Rotated(reference_from_estimate);
    std::vector<std::tuple<double, size_t, size_t>> costs;
    for (size_t i = 0; i < size(); ++i) {
      for (size_t j = 0; j < size(); ++j) {
        costs.emplace_back(Cost(reference_from_estimate, centres[i], i, j), i, j);
      }
    }
    std::sort(costs.begin(), costs.end());
    constexpr size_t kNone = std::numeric_limits<size_t>::max();
    std::vector<size_t> estimate_of(size(), kNone);
    std::vector<bool> is_taken(size());
    for (const auto& [cost, i, j] : costs) {
      if (is_taken[i] || estimate_of[j] != kNone) continue;
      is_taken[i] = true;
      estimate_of[j] = i;
    }
    return estimate_of;
  }

  const std::vector<Rigid3d>& estimate_;
  const std::vector<Rigid3d>& reference_;
  const std::vector<Eigen::Vector3d> estimate_centres_;
  const std::vector<Eigen::Vector3d> reference_centres_;
};

}  // namespace

std::optional<BetterReading> FindBetterReading(const std::vector<NamedPose>& estimate,
                                               const std::vector<std::vector<NamedPose>>& readings,
                                               const std::vector<NamedPose>& reference) {
  const CommonPoses as_read = FindCommonPoses(estimate, reference, kMaxViews);
  if (as_read.names.size() < kMinViews) return std::nullopt;
  const double error_as_read_deg = MedianErrorDeg(as_read.estimate, as_read.reference);
  BetterReading best;
  best.error_deg = std::numeric_limits<double>::infinity();
  best.error_as_read_deg = error_as_read_deg;
  for (size_t i = 0; i < readings.size(); ++i) {
    const CommonPoses common = FindCommonPoses(readings[i], reference, kMaxViews);
    const double error_deg = MedianErrorDeg(common.estimate, common.reference);
    if (error_deg * kPlainerRatio + kRoundingDeg >= best.error_deg) continue;
    best.idx = i;
    best.error_deg = error_deg;
  }
  if (!IsFarBetter(best.error_deg, error_as_read_deg)) return std::nullopt;
  return best;
}

std::optional<ShuffledNames> FindShuffledNames(const std::vector<NamedPose>& estimate,
                                               const std::vector<NamedPose>& reference) {
  const CommonPoses common =
      FindCommonPoses(estimate, reference, std::numeric_limits<size_t>::max());
  const size_t num_views = common.names.size();
  if (num_views < kMinShuffledViews || num_views > kMaxShuffledViews) return std::nullopt;
  ShuffledNames shuffled;
  shuffled.error_as_read_deg = MedianErrorDeg(common.estimate, common.reference);
  if (shuffled.error_as_read_deg < kMinErrorDeg) return std::nullopt;
  const std::vector<size_t> estimate_of = PoseAssigner(common.estimate, common.reference).Assign();
  std::vector<Rigid3d> reordered;
  for (size_t i = 0; i < num_views; ++i) {
    reordered.push_back(common.estimate[estimate_of[i]]);
    if (estimate_of[i] == i) continue;
    shuffled.exchanges.push_back({common.names[estimate_of[i]], common.names[i]});
  }
  shuffled.error_deg = MedianErrorDeg(reordered, common.reference);
  if (!IsFarBetter(shuffled.error_deg, shuffled.error_as_read_deg)) return std::nullopt;
  return shuffled;
}

}  // namespace vgtw
