// SPDX-License-Identifier: BSD-3-Clause
#include "scene/geodetic.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace vgtw {
namespace {

// Source: NGA.STND.0036, World Geodetic System 1984, 2014, table 3.1.
constexpr double kSemiMajorAxis = 6378137.0;  // metres
constexpr double kFlattening = 1.0 / 298.257223563;
constexpr double kEccentricitySquared = kFlattening * (2.0 - kFlattening);

double Radians(double angle_deg) { return angle_deg * std::numbers::pi / 180.0; }

}  // namespace

Eigen::Vector3d EcefFromGeodetic(const GeodeticPosition& position) {
  const double latitude = Radians(position.latitude_deg);
  const double longitude = Radians(position.longitude_deg);
  const double sine = std::sin(latitude);
  const double normal_radius = kSemiMajorAxis / std::sqrt(1.0 - kEccentricitySquared * sine * sine);
  const double axis_distance = (normal_radius + position.altitude) * std::cos(latitude);
  return {axis_distance * std::cos(longitude),
          axis_distance * std::sin(longitude),
          ((1.0 - kEccentricitySquared) * normal_radius + position.altitude) * sine};
}

Eigen::Vector3d EnuFromGeodetic(const GeodeticPosition& position, const GeodeticPosition& origin) {
  const double latitude = Radians(origin.latitude_deg);
  const double longitude = Radians(origin.longitude_deg);
  const Eigen::Vector3d east(-std::sin(longitude), std::cos(longitude), 0.0);
  const Eigen::Vector3d up(std::cos(latitude) * std::cos(longitude),
                           std::cos(latitude) * std::sin(longitude),
                           std::sin(latitude));
  const Eigen::Vector3d offset = EcefFromGeodetic(position) - EcefFromGeodetic(origin);
  return {east.dot(offset), up.cross(east).dot(offset), up.dot(offset)};
}

}  // namespace vgtw
