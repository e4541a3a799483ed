// SPDX-License-Identifier: BSD-3-Clause
#include "refine/gauge.h"

#include <cmath>
#include <map>
#include <optional>

#include <Eigen/Core>

namespace vgtw {
namespace {

double Distance(const GaugeImage& a, const GaugeImage& b) {
  return (OriginInSource(a.cam_from_world) - OriginInSource(b.cam_from_world)).norm();
}

// The held image with the most observations, else the image with the most.
size_t ChooseReference(const std::vector<GaugeImage>& images, const std::vector<size_t>& members) {
  size_t best = members.front();
  for (const size_t i : members) {
    const bool better = images[i].is_held != images[best].is_held
                            ? images[i].is_held
                            : images[i].num_observations > images[best].num_observations;
    if (better) best = i;
  }
  return best;
}

// The image farthest from `reference` among the held or the free ones; nullopt if none has a
// baseline.
std::optional<size_t> Farthest(const std::vector<GaugeImage>& images,
                               const std::vector<size_t>& members,
                               size_t reference,
                               bool held) {
  std::optional<size_t> farthest;
  double max_distance = 0.0;
  for (const size_t i : members) {
    const double distance = Distance(images[i], images[reference]);
    if (i == reference || images[i].is_held != held || !(distance > max_distance)) continue;
    max_distance = distance;
    farthest = i;
  }
  return farthest;
}

int LargestCoordinate(const GaugeImage& image, const GaugeImage& reference) {
  const Eigen::Vector3d centre_to_centre =
      image.cam_from_world * OriginInSource(reference.cam_from_world);
  int coordinate = 0;
  centre_to_centre.cwiseAbs().maxCoeff(&coordinate);
  return coordinate;
}

}  // namespace

Gauge ChooseGauge(const std::vector<GaugeImage>& images) {
  Gauge gauge;
  gauge.held_coordinates.assign(images.size(), -1);
  std::map<size_t, std::vector<size_t>> members_by_component;
  for (size_t i = 0; i < images.size(); ++i) {
    gauge.is_held.push_back(images[i].is_held);
    members_by_component[images[i].component].push_back(i);
  }
  for (const auto& [component, members] : members_by_component) {
    const size_t reference = ChooseReference(images, members);
    gauge.is_held[reference] = true;
    if (!gauge.description.empty()) gauge.description += "; ";
    gauge.description += "pose of " + images[reference].name;
    const bool scale_is_held =
        images[reference].is_held && Farthest(images, members, reference, true).has_value();
    const std::optional<size_t> other = Farthest(images, members, reference, false);
    if (scale_is_held) {
      gauge.description += " and of other held images";
    } else if (other) {
      const int coordinate = LargestCoordinate(images[*other], images[reference]);
      gauge.held_coordinates[*other] = coordinate;
      gauge.description += ", t" + std::string(1, "xyz"[coordinate]) + " of " + images[*other].name;
    }
  }
  return gauge;
}

}  // namespace vgtw
