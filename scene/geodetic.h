// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace vgtw {

// A place on the ellipsoid WGS84, as GPS gives it.
struct GeodeticPosition {
  double latitude_deg = 0.0;   // [-90, 90], north positive
  double longitude_deg = 0.0;  // east positive
  double altitude = 0.0;       // metres above the ellipsoid
};

// Earth-centred, earth-fixed: x towards latitude 0 and longitude 0, z towards the north pole,
// metres.
Eigen::Vector3d EcefFromGeodetic(const GeodeticPosition& position);

// Metres east, north and up (along the ellipsoid's normal) of `origin`.
Eigen::Vector3d EnuFromGeodetic(const GeodeticPosition& position, const GeodeticPosition& origin);

}  // namespace vgtw
