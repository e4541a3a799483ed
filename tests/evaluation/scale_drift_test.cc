// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/scale_drift.h"

#include "scene/sim3d.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Poses = std::map<std::string, Rigid3d>;

// Cameras along x at these places.
Poses Along(const std::vector<double>& places) {
  Poses poses;
  for (size_t i = 0; i < places.size(); ++i) {
    poses[std::to_string(10 + i)].translation.x() = -places[i];
  }
  return poses;
}

TEST(ScaleDriftPercent, IsZeroUpToASimilarity) {
  const Poses reference = Along({0.0, 1.0, 2.5, 3.0, 4.5, 7.0, 8.0});
  Sim3d change;
  change.scale = 3.0;
  change.rotation = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized());
  change.translation = {4.0, 5.0, 6.0};
  Poses estimate;
  for (const auto& [name, pose] : reference) estimate[name] = TransformCamera(change, pose);
  EXPECT_NEAR(ScaleDriftPercent(estimate, reference).value(), 0.0, 1e-10);
}

TEST(ScaleDriftPercent, IsTheSpreadOfScales) {
  // 31 unit steps, the later half 10 % longer: of the ratios nearly all are 1 or 1.1.
  std::vector<double> places;
  std::vector<double> stretched;
  for (int i = 0; i <= 60; ++i) {
    places.push_back(i);
    stretched.push_back(i <= 30 ? i : 30.0 + 1.1 * (i - 30));
  }
  const double drift = ScaleDriftPercent(Along(stretched), Along(places)).value();
  // Half of 0.1 over the median, which lies on either side of the step.
  EXPECT_GE(drift, 5.0 / 1.1 - 1e-9);
  EXPECT_LE(drift, 5.0 + 1e-9);
}

TEST(ScaleDriftPercent, NeedsThreeViews) {
  EXPECT_FALSE(ScaleDriftPercent(Along({0.0, 1.0}), Along({0.0, 1.0})).has_value());
  EXPECT_FALSE(ScaleDriftPercent(Along({0.0, 1.0, 2.0}), Along({3.0, 3.0, 3.0})).has_value());
  EXPECT_FALSE(ScaleDriftPercent(Along({3.0, 3.0, 3.0}), Along({0.0, 1.0, 2.0})).has_value());
}

}  // namespace
}  // namespace vgtw
