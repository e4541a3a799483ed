// SPDX-License-Identifier: BSD-3-Clause
#include "scene/geodetic.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

void ExpectNear(const Eigen::Vector3d& value, const Eigen::Vector3d& expected, double tolerance) {
  EXPECT_LT((value - expected).norm(), tolerance)
      << value.transpose() << " instead of " << expected.transpose();
}

TEST(EcefFromGeodetic, GivesTheEllipsoidsAxes) {
  ExpectNear(EcefFromGeodetic({0.0, 0.0, 0.0}), {6378137.0, 0.0, 0.0}, 1e-8);
  ExpectNear(EcefFromGeodetic({0.0, 90.0, 10.0}), {0.0, 6378147.0, 0.0}, 1e-8);
  // The semi-minor axis as the standard prints it.
  ExpectNear(EcefFromGeodetic({90.0, 0.0, 0.0}), {0.0, 0.0, 6356752.3142}, 1e-4);
  ExpectNear(EcefFromGeodetic({-90.0, 123.0, 5.0}), {0.0, 0.0, -6356757.3142}, 1e-4);
}

// Zermatt to the Matterhorn, as documented by MathWorks for geodetic2enu, to the printed 0.1 m.
TEST(EnuFromGeodetic, GivesAPublishedExample) {
  ExpectNear(EnuFromGeodetic({45.976, 7.658, 4531.0}, {46.017, 7.750, 1673.0}),
             {-7134.8, -4556.3, 2852.4},
             0.1);
}

TEST(EnuFromGeodetic, ItsAxesPointEastNorthAndUp) {
  const GeodeticPosition origin = {48.2, 16.4, 200.0};
  ExpectNear(EnuFromGeodetic(origin, origin), Eigen::Vector3d::Zero(), 1e-12);
  ExpectNear(EnuFromGeodetic({48.2, 16.4, 230.0}, origin), {0.0, 0.0, 30.0}, 1e-8);
  // By the radii of curvature M = a (1 - e^2) / w^3 and N = a / w with w^2 = 1 - e^2 sin^2: 1e-4
  // degrees are (M + 200) 1.745329e-6 = 11.1198 m north and (N + 200) cos(48.2) 1.745329e-6
  // = 7.4339 m east; a chord bends by less than 0.01 mm.
  ExpectNear(EnuFromGeodetic({48.2001, 16.4, 200.0}, origin), {0.0, 11.1198, 0.0}, 1e-3);
  ExpectNear(EnuFromGeodetic({48.2, 16.4001, 200.0}, origin), {7.4339, 0.0, 0.0}, 1e-3);
}

}  // namespace
}  // namespace vgtw
