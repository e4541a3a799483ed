// SPDX-License-Identifier: BSD-3-Clause
#include "matching/assumed_depth.h"

#include "scene/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

namespace vgtw {
namespace {

constexpr size_t kMaxAsked = 256;
constexpr size_t kNeighbourRank = 8;

struct Axis {
  Eigen::Vector3d centre;
  Eigen::Vector3d direction;
};

Axis AxisOf(const View& view) {
  return {OriginInSource(view.cam_from_world),
          view.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ()};
}

// Distance from a's centre to where the axes are nearest to each other, if that is in front of
// both, at an angle that tells where, and they pass each other closely.
std::optional<double> MeetingDistance(const Axis& a, const Axis& b) {
  constexpr double kMinSine = 0.09;  // 5 deg
  constexpr double kMaxRelativeGap = 0.25;
  const double cosine = a.direction.dot(b.direction);
  const double squared_sine = 1.0 - cosine * cosine;
  if (squared_sine < kMinSine * kMinSine) return std::nullopt;
  const Eigen::Vector3d baseline = b.centre - a.centre;
  const double along_a = baseline.dot(a.direction);
  const double along_b = baseline.dot(b.direction);
  const double distance_a = (along_a - cosine * along_b) / squared_sine;
  const double distance_b = (cosine * along_a - along_b) / squared_sine;
  if (!(distance_a > 0.0 && distance_b > 0.0)) return std::nullopt;
  const double gap =
      (a.centre + distance_a * a.direction - b.centre - distance_b * b.direction).norm();
  if (gap > kMaxRelativeGap * std::min(distance_a, distance_b)) return std::nullopt;
  return distance_a;
}

// nullopt unless most pairs of axes meet.
std::optional<double> MedianMeetingDistance(const std::vector<Axis>& axes) {
  std::vector<double> distances;
  size_t num_pairs = 0;
  for (size_t i = 0; i < axes.size(); ++i) {
    for (size_t j = 0; j < axes.size(); ++j) {
      if (i == j) continue;
      ++num_pairs;
      if (const auto distance = MeetingDistance(axes[i], axes[j])) distances.push_back(*distance);
    }
  }
  if (distances.empty() || 2 * distances.size() <= num_pairs) return std::nullopt;
  return Median(std::move(distances));
}

// Depth at which the picture is four times as wide as the way to the 8th nearest view.
double DepthByNeighbours(const View& view, const std::vector<View>& views) {
  const Eigen::Vector3d centre = OriginInSource(view.cam_from_world);
  std::vector<double> distances;  // the view's own, 0, is one of them
  distances.reserve(views.size());
  for (const View& other : views) {
    distances.push_back((OriginInSource(other.cam_from_world) - centre).norm());
  }
  const size_t rank = std::min(kNeighbourRank, distances.size() - 1);
  const auto nth = distances.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(distances.begin(), nth, distances.end());
  return 4.0 * *nth * view.camera.MeanFocalLength() / static_cast<double>(view.camera.width);
}

}  // namespace

double AssumedDepth(const std::vector<View>& views) {
  const size_t num_asked = std::min(views.size(), kMaxAsked);
  std::vector<Axis> axes;
  std::vector<double> depths;
  for (size_t i = 0; i < num_asked; ++i) {
    const View& view = views[i * views.size() / num_asked];
    axes.push_back(AxisOf(view));
    const double depth = DepthByNeighbours(view, views);
    if (depth > 0.0) depths.push_back(depth);
  }
  if (const auto distance = MedianMeetingDistance(axes)) return *distance;
  return depths.empty() ? 1.0 : Median(std::move(depths));
}

}  // namespace vgtw
