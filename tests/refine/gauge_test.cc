// SPDX-License-Identifier: BSD-3-Clause
#include "refine/gauge.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

GaugeImage At(const std::string& name, const Eigen::Vector3d& centre, size_t num_observations) {
  return {name, {Eigen::Quaterniond::Identity(), -centre}, num_observations, 0, false};
}

TEST(ChooseGauge, HoldsTheBestObservedImageAndTheFarthestFromIt) {
  const Gauge gauge =
      ChooseGauge({At("a", {0, 0, 0}, 5), At("b", {1, 0, 0}, 9), At("c", {2, 3, 1}, 7)});
  EXPECT_EQ(gauge.is_held, (std::vector<bool>{false, true, false}));
  EXPECT_EQ(gauge.held_coordinates, (std::vector<int>{-1, -1, 1}));
  EXPECT_EQ(gauge.description, "pose of b, ty of c");
}

// b's translation is (0, 0, -10), but growing about a's centre moves it along x only.
TEST(ChooseGauge, HeldCoordinateIsTheOneThatScaleMoves) {
  const Gauge gauge = ChooseGauge({At("a", {0, 0, 10}, 9), At("b", {1, 0, 10}, 5)});
  EXPECT_EQ(gauge.held_coordinates, (std::vector<int>{-1, 0}));
}

TEST(ChooseGauge, AHeldImageServesAsTheReference) {
  std::vector<GaugeImage> images = {
      At("a", {0, 0, 0}, 1), At("b", {1, 0, 0}, 9), At("c", {0, 0, 4}, 7)};
  images[0].is_held = true;
  const Gauge gauge = ChooseGauge(images);
  EXPECT_EQ(gauge.is_held, (std::vector<bool>{true, false, false}));
  EXPECT_EQ(gauge.held_coordinates, (std::vector<int>{-1, -1, 2}));
}

TEST(ChooseGauge, TwoHeldImagesFixTheScaleUnlessTheirCentresCoincide) {
  std::vector<GaugeImage> images = {
      At("a", {0, 0, 0}, 1), At("b", {1, 0, 0}, 9), At("c", {0, 0, 4}, 7)};
  images[0].is_held = images[1].is_held = true;
  EXPECT_EQ(ChooseGauge(images).held_coordinates, (std::vector<int>{-1, -1, -1}));
  images[1].cam_from_world = images[0].cam_from_world;
  EXPECT_EQ(ChooseGauge(images).held_coordinates, (std::vector<int>{-1, -1, 2}));
}

TEST(ChooseGauge, EachComponentHasItsOwn) {
  std::vector<GaugeImage> images = {
      At("a", {0, 0, 0}, 5), At("b", {1, 0, 0}, 9), At("c", {2, 3, 1}, 7), At("d", {2, 3, 9}, 6)};
  images[2].component = images[3].component = 2;
  const Gauge gauge = ChooseGauge(images);
  EXPECT_EQ(gauge.is_held, (std::vector<bool>{false, true, true, false}));
  EXPECT_EQ(gauge.held_coordinates, (std::vector<int>{0, -1, -1, 2}));
  EXPECT_EQ(gauge.description, "pose of b, tx of a; pose of c, tz of d");
}

TEST(ChooseGauge, CamerasInOnePlaceHaveNoScale) {
  const Gauge gauge = ChooseGauge({At("a", {1, 1, 1}, 5), At("b", {1, 1, 1}, 9)});
  EXPECT_EQ(gauge.is_held, (std::vector<bool>{false, true}));
  EXPECT_EQ(gauge.held_coordinates, (std::vector<int>{-1, -1}));
}

}  // namespace
}  // namespace vgtw
