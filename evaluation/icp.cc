// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/icp.h"

#include "scene/error.h"

#include <cmath>
#include <string>
#include <vector>

namespace vgtw {
namespace {

// Points of the source and of the target that belong together.
struct Pairs {
  std::vector<Eigen::Vector3d> in_source;
  std::vector<Eigen::Vector3d> in_target;
  size_t num_points = 0;  // that were asked for a partner
  double sum_squared = 0.0;

  double Share() const {
    return static_cast<double>(in_source.size()) / static_cast<double>(num_points);
  }
  double Rmse() const {
    return in_source.empty() ? 0.0 : std::sqrt(sum_squared / static_cast<double>(in_source.size()));
  }
};

class Icp {
 public:
  Icp(const PointTree& source, const PointTree& target, const IcpOptions& options)
      : source_(source),
        target_(target),
        source_points_(source.Points()),
        target_points_(target.Points()),
        options_(options) {}

  Pairs FindPairs(const Sim3d& target_from_source) const {
    Pairs pairs;
    const double max_squared = options_.max_distance * options_.max_distance;
    const auto add = [&](const Eigen::Vector3d& in_source,
                         const Eigen::Vector3d& in_target,
                         double squared_distance) {
      ++pairs.num_points;
      if (!(squared_distance <= max_squared)) return;
      pairs.in_source.push_back(in_source);
      pairs.in_target.push_back(in_target);
      pairs.sum_squared += squared_distance;
    };
    const std::vector<Neighbour> in_target =
        target_.NearestOfAll(source_, target_from_source, options_.num_threads);
    for (size_t i = 0; i < in_target.size(); ++i) {
      const Neighbour& nearest = in_target[i];
      add(source_points_[i], target_points_[nearest.idx], nearest.squared_distance);
    }
    if (!options_.with_scale) return pairs;
    const double squared_scale = target_from_source.scale * target_from_source.scale;
    const std::vector<Neighbour> in_source =
        source_.NearestOfAll(target_, Inverse(target_from_source), options_.num_threads);
    for (size_t i = 0; i < in_source.size(); ++i) {
      const Neighbour& nearest = in_source[i];
      add(source_points_[nearest.idx], target_points_[i], squared_scale * nearest.squared_distance);
    }
    return pairs;
  }

  // The best motion for the pairs. `scale` is kept unless it is looked for, too.
  std::optional<Sim3d> Fit(const Pairs& pairs, double scale) const {
    std::optional<Sim3d> fit = EstimateSim3d(pairs.in_source, pairs.in_target);
    if (!fit || options_.with_scale) return fit;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : pairs.in_source) mean += point;
    mean /= static_cast<double>(pairs.in_source.size());
    const Eigen::Vector3d mean_in_target = *fit * mean;
    fit->scale = scale;
    fit->translation = mean_in_target - scale * (fit->rotation * mean);
    return fit;
  }

 private:
  const PointTree& source_;
  const PointTree& target_;
  std::vector<Eigen::Vector3d> source_points_;
  std::vector<Eigen::Vector3d> target_points_;
  const IcpOptions& options_;
};

}  // namespace

void IcpOptions::Check() const {
  VGTW_CHECK(std::isfinite(max_distance) && max_distance > 0.0,
             "IcpOptions::max_distance = " + std::to_string(max_distance) + ", must be > 0");
  VGTW_CHECK(max_iterations > 0,
             "IcpOptions::max_iterations = " + std::to_string(max_iterations) + ", must be > 0");
  VGTW_CHECK(min_change >= 0.0,
             "IcpOptions::min_change = " + std::to_string(min_change) + ", must be >= 0");
}

std::optional<IcpResult> AlignByIcp(const PointTree& source,
                                    const PointTree& target,
                                    const Sim3d& target_from_source,
                                    const IcpOptions& options) {
  options.Check();
  const Icp icp(source, target, options);
  IcpResult result;
  result.target_from_source = target_from_source;
  Pairs pairs = icp.FindPairs(target_from_source);
  while (!result.converged && result.num_iterations < options.max_iterations) {
    const auto fit = icp.Fit(pairs, target_from_source.scale);
    if (!fit) return std::nullopt;
    ++result.num_iterations;
    result.target_from_source = *fit;
    const double share = pairs.Share();
    const double rmse = pairs.Rmse();
    pairs = icp.FindPairs(*fit);
    result.converged = std::abs(pairs.Share() - share) < options.min_change &&
                       std::abs(pairs.Rmse() - rmse) < options.min_change;
  }
  result.share_paired = pairs.Share();
  result.rmse = pairs.Rmse();
  return result;
}

}  // namespace vgtw
