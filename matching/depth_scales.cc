// SPDX-License-Identifier: BSD-3-Clause
#include "matching/depth_scales.h"

#include "scene/disjoint_sets.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>

namespace vgtw {
namespace {

constexpr double kSigmaOfMedianDeviation = 1.4826;  // of a normal distribution

// A keypoint that two views have in common. The point that `from` lifts lies in `to` at the depth
// offset + scale of `from` * slope, where the offset belongs to the two views.
struct Link {
  uint32_t from = 0;  // index of the view
  uint32_t to = 0;
  float slope = 0.0f;
  float depth = 0.0f;  // predicted by `to`
};

// All links between two views.
struct ViewPair {
  uint32_t from = 0;
  uint32_t to = 0;
  double offset = 0.0;
  size_t begin = 0;  // in the list of links
  size_t end = 0;

  // At the present scales:
  double residual = 0.0;    // median of log z - log(s D)
  double derivative = 1.0;  // of it by log of the scale of `from`; by that of `to` it is -1
  double deviation = 0.0;   // median of |log z - log(s D)|
  double sigma = 1.0;       // of the residual
};

struct Sighting {
  uint32_t view_idx = 0;
  Eigen::Vector3d ray_in_world = Eigen::Vector3d::Zero();  // z = 1 in the camera
  double depth = 0.0;
};

class DepthGraph {
 public:
  DepthGraph(const std::map<ImageId, ViewFeatures>& views, const DepthScaleOptions& options)
      : options_(options), log_scales_(views.size(), 0.0) {
    for (const auto& [image_id, view] : views) {
      image_ids_.push_back(image_id);
      views_.push_back(&view);
      cam_from_world_rotations_.push_back(view.view.cam_from_world.rotation.toRotationMatrix());
    }
  }

  void AddTrack(const std::vector<TrackElement>& track) {
    std::vector<Sighting> sightings;
    for (const TrackElement& element : track) {
      const auto found = std::lower_bound(image_ids_.begin(), image_ids_.end(), element.image_id);
      if (found == image_ids_.end() || *found != element.image_id) continue;
      const auto view_idx = static_cast<uint32_t>(found - image_ids_.begin());
      const ViewFeatures& view = *views_[view_idx];
      VGTW_CHECK(element.point2D_idx < view.size(),
                 "image " + std::to_string(element.image_id) + " has no keypoint " +
                     std::to_string(element.point2D_idx));
      const double depth = view.depths[element.point2D_idx];
      const auto world_from_cam = cam_from_world_rotations_[view_idx].transpose();
      const Eigen::Vector3d ray = view.rays[element.point2D_idx].cast<double>().homogeneous();
      if (std::isfinite(depth) && depth > 0.0 && ray.allFinite()) {
        sightings.push_back({view_idx, world_from_cam * ray, depth});
      }
    }
    std::sort(sightings.begin(), sightings.end(), [](const Sighting& x, const Sighting& y) {
      return x.view_idx < y.view_idx;
    });
    // At distances of 1, 2, 4, ... in the track: all pairs would grow with its square.
    for (size_t step = 1; step < sightings.size(); step *= 2) {
      for (size_t i = step; i < sightings.size(); ++i) AddLink(sightings[i - step], sightings[i]);
    }
  }

  DepthScales Solve() {
    GroupLinks();
    FindComponents();
    for (int i = 0; i < options_.max_iterations; ++i) {
      FixGauge();
      if (Iterate() < kConverged) break;
    }
    FixGauge();
    return Report();
  }

 private:
  static constexpr double kConverged = 1e-7;

  void AddLink(const Sighting& from, const Sighting& to) {
    if (from.view_idx == to.view_idx) return;
    const double slope = cam_from_world_rotations_[to.view_idx].row(2).dot(from.ray_in_world);
    links_.push_back({from.view_idx,
                      to.view_idx,
                      static_cast<float>(slope * from.depth),
                      static_cast<float>(to.depth)});
  }

  void GroupLinks() {
    std::sort(links_.begin(), links_.end(), [](const Link& x, const Link& y) {
      return std::tie(x.from, x.to, x.slope, x.depth) < std::tie(y.from, y.to, y.slope, y.depth);
    });
    for (size_t begin = 0, end = 0; begin < links_.size(); begin = end) {
      const Link& first = links_[begin];
      while (end < links_.size() && links_[end].from == first.from && links_[end].to == first.to) {
        ++end;
      }
      if (end - begin < static_cast<size_t>(options_.min_links)) continue;
      const Eigen::Vector3d centre = OriginInSource(views_[first.from]->view.cam_from_world);
      const double offset = (views_[first.to]->view.cam_from_world * centre).z();
      pairs_.push_back({first.from, first.to, offset, begin, end});
    }
  }

  void FindComponents() {
    DisjointSets<> sets(views_.size());
    for (const ViewPair& pair : pairs_) sets.Join(pair.from, pair.to);
    component_.resize(views_.size());
    for (size_t i = 0; i < component_.size(); ++i) component_[i] = sets.Find(i);
  }

  // Moves the median of each component to 0; the median views are anchors of the next iteration.
  void FixGauge() {
    std::vector<size_t> order(views_.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](size_t i, size_t j) {
      return std::tie(component_[i], log_scales_[i], i) <
             std::tie(component_[j], log_scales_[j], j);
    });
    is_anchor_.assign(views_.size(), false);
    for (size_t begin = 0, end = 0; begin < order.size(); begin = end) {
      while (end < order.size() && component_[order[end]] == component_[order[begin]]) ++end;
      const size_t anchor = order[begin + (end - begin - 1) / 2];
      const double median = log_scales_[anchor];
      is_anchor_[anchor] = true;
      for (size_t k = begin; k < end; ++k) log_scales_[order[k]] -= median;
    }
  }

  void Evaluate(ViewPair& pair) const {
    const double scale = std::exp(log_scales_[pair.from]);
    std::vector<double> residuals;
    std::vector<double> derivatives;
    for (size_t i = pair.begin; i < pair.end; ++i) {
      const double z_without_offset = scale * links_[i].slope;
      const double z = pair.offset + z_without_offset;
      if (!(z > 0.0)) continue;  // a wrong match
      residuals.push_back(std::log(z / links_[i].depth) - log_scales_[pair.to]);
      derivatives.push_back(z_without_offset / z);
    }
    if (residuals.empty()) {
      pair.sigma = std::numeric_limits<double>::infinity();
      return;
    }
    const auto num_residuals = static_cast<double>(residuals.size());
    pair.residual = Median(residuals);
    pair.derivative = Median(std::move(derivatives));
    std::vector<double> deviations;
    for (double& residual : residuals) {
      deviations.push_back(std::abs(residual - pair.residual));
      residual = std::abs(residual);
    }
    pair.deviation = Median(std::move(residuals));
    // A median's variance is pi/2 times that of a mean.
    const double sigma_of_one = kSigmaOfMedianDeviation * Median(std::move(deviations));
    pair.sigma = std::hypot(options_.noise_floor, sigma_of_one * std::sqrt(1.57 / num_residuals));
  }

  // One step of iteratively reweighted least squares; returns the largest change of a log scale.
  double Iterate() {
    const auto num_views = static_cast<Eigen::Index>(views_.size());
    // Holds anchors, and views whose pairs are all without valid links, where they are.
    constexpr double kHold = 1e20;
    constexpr double kDamping = 1e-6;
    std::vector<Eigen::Triplet<double>> hessian;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(num_views);
    for (Eigen::Index i = 0; i < num_views; ++i) {
      hessian.emplace_back(i, i, is_anchor_[static_cast<size_t>(i)] ? kHold : kDamping);
    }
    for (ViewPair& pair : pairs_) {
      Evaluate(pair);
      if (std::isinf(pair.sigma)) continue;
      const double weight = 1.0 / (pair.sigma * std::max(pair.sigma, std::abs(pair.residual)));
      const auto from = static_cast<Eigen::Index>(pair.from);
      const auto to = static_cast<Eigen::Index>(pair.to);
      hessian.emplace_back(from, from, weight * pair.derivative * pair.derivative);
      hessian.emplace_back(to, to, weight);
      hessian.emplace_back(std::max(from, to), std::min(from, to), -weight * pair.derivative);
      gradient[from] += weight * pair.derivative * pair.residual;
      gradient[to] -= weight * pair.residual;
    }
    if (pairs_.empty()) return 0.0;
    Eigen::SparseMatrix<double> matrix(num_views, num_views);
    matrix.setFromTriplets(hessian.begin(), hessian.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(matrix);
    const Eigen::VectorXd change = -solver.solve(gradient);
    if (!change.allFinite()) return 0.0;
    constexpr double kMaxChange = 0.5;
    for (size_t i = 0; i < log_scales_.size(); ++i) {
      log_scales_[i] += std::clamp(change[static_cast<Eigen::Index>(i)], -kMaxChange, kMaxChange);
    }
    return change.cwiseAbs().maxCoeff();
  }

  DepthScales Report() {
    std::vector<std::vector<double>> deviations(views_.size());
    std::vector<size_t> num_links(views_.size(), 0);
    for (ViewPair& pair : pairs_) {
      Evaluate(pair);
      for (const size_t i : {pair.from, pair.to}) {
        num_links[i] += pair.end - pair.begin;
        if (!std::isinf(pair.sigma)) deviations[i].push_back(pair.deviation);
      }
    }
    DepthScales scales;
    for (size_t i = 0; i < views_.size(); ++i) {
      DepthScale& scale = scales[image_ids_[i]];
      scale.num_links = num_links[i];
      if (deviations[i].empty()) continue;
      scale.scale = std::exp(log_scales_[i]);
      scale.spread = kSigmaOfMedianDeviation / std::sqrt(2.0) * Median(std::move(deviations[i]));
    }
    return scales;
  }

  DepthScaleOptions options_;
  std::vector<ImageId> image_ids_;  // ascending, by index of view
  std::vector<const ViewFeatures*> views_;
  std::vector<Eigen::Matrix3d> cam_from_world_rotations_;
  std::vector<Link> links_;
  std::vector<ViewPair> pairs_;
  std::vector<size_t> component_;
  std::vector<bool> is_anchor_;
  std::vector<double> log_scales_;
};

}  // namespace

void DepthScaleOptions::Check() const {
  VGTW_CHECK(
      min_links >= 1 && min_links <= 1000000,
      "DepthScaleOptions::min_links = " + std::to_string(min_links) + ", must be in [1, 10^6]");
  VGTW_CHECK(
      noise_floor > 0.0 && noise_floor <= 1.0,
      "DepthScaleOptions::noise_floor = " + std::to_string(noise_floor) + ", must be in (0, 1]");
  VGTW_CHECK(max_iterations >= 1 && max_iterations <= 10000,
             "DepthScaleOptions::max_iterations = " + std::to_string(max_iterations) +
                 ", must be in [1, 10^4]");
}

DepthScales EstimateDepthScales(const std::map<ImageId, ViewFeatures>& views,
                                const std::vector<std::vector<TrackElement>>& tracks,
                                const DepthScaleOptions& options) {
  options.Check();
  DepthGraph graph(views, options);
  for (const std::vector<TrackElement>& track : tracks) graph.AddTrack(track);
  return graph.Solve();
}

}  // namespace vgtw
