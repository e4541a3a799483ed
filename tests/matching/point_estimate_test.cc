// SPDX-License-Identifier: BSD-3-Clause
#include "matching/point_estimate.h"

#include "scene/random.h"
#include "scene/statistics.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::ElementsAre;

constexpr PointLimits kLimits = {.ray_sigma_rad = 0.002, .max_ray_rad = 0.05, .max_sigmas = 3.0};

// A camera at `centre` that looks along z and sees `point` with a depth off by `factor`.
Sighting See(const Eigen::Vector3d& centre, const Eigen::Vector3d& point, double factor = 1.0) {
  Sighting sighting;
  sighting.centre = centre;
  sighting.ray = (point - centre).normalized();
  sighting.range = factor * (point - centre).norm();
  sighting.range_sigma = 0.02;
  return sighting;
}

TEST(EstimatePoint, MeetsExactSightings) {
  const Eigen::Vector3d point(0.3, -0.2, 5.0);
  const std::vector<Sighting> sightings = {See({-1, 0, 0}, point), See({1, 0, 0}, point)};
  const auto estimate = EstimatePoint(sightings, kLimits);
  ASSERT_TRUE(estimate);
  EXPECT_LT((estimate->xyz - point).norm(), 1e-12);
  EXPECT_THAT(estimate->agreeing, ElementsAre(0, 1));
  EXPECT_LT(estimate->errors_rad[1], 1e-12);
}

// Two cameras at one place: range 4 with sigma 2 % and range 4.1 with sigma 2 % of 4.1. Weights
// 1/0.08^2 and 1/0.082^2 give 4.04876; sigma is that of the mean of two along, and
// 4.05 * 0.002 / sqrt(2) on both axes across. Tukey's weights pull by less than 1e-3.
TEST(EstimatePoint, WeighsDepthsByTheirSigma) {
  const Eigen::Vector3d point(0.0, 0.0, 4.0);
  const std::vector<Sighting> sightings = {See({0, 0, 0}, point), See({0, 0, 0}, point, 1.025)};
  const auto estimate = EstimatePoint(sightings, kLimits);
  ASSERT_TRUE(estimate);
  EXPECT_NEAR(estimate->xyz.z(), 4.04876, 1e-3);
  // The weight of an error of 0.62 sigma is 0.917, which makes sigma 4 % larger.
  const double sigma = std::hypot(0.081, 0.0081) / std::sqrt(2.0);
  EXPECT_GT(estimate->sigma, sigma);
  EXPECT_LT(estimate->sigma, 1.06 * sigma);
}

// Where rays meet at a right angle, depths off by 4 % in both views do not matter: across the sigma
// is 0.002 * 4 = 0.008, along 0.08. The point moves by the share 0.008^2 / 0.08^2 = 1 % of 0.16.
TEST(EstimatePoint, RaysDecideWhereTheyMeet) {
  const Eigen::Vector3d point(0.0, 0.0, 4.0);
  std::vector<Sighting> sightings = {See({0, 0, 0}, point, 1.04), See({-4, 0, 4}, point, 1.04)};
  sightings[1].axis = Eigen::Vector3d::UnitX();
  auto estimate = EstimatePoint(sightings, kLimits);
  ASSERT_TRUE(estimate);
  EXPECT_LT((estimate->xyz - point).cwiseAbs().maxCoeff(), 0.01 * 0.16);
  const double sigma_of_contradiction = estimate->sigma;
  for (Sighting& sighting : sightings) sighting.range = 4.0;
  estimate = EstimatePoint(sightings, kLimits);
  ASSERT_TRUE(estimate);
  // One ray decides along x, one along z, both along y; depths add 1 %.
  EXPECT_NEAR(estimate->sigma, 0.008 * std::sqrt(1.0 + 1.0 + 0.5), 0.01 * 0.008);
  EXPECT_GT(sigma_of_contradiction, 1.1 * estimate->sigma);
}

TEST(EstimatePoint, AnOutlierHasNoWeight) {
  const Eigen::Vector3d point(0.0, 0.0, 4.0);
  for (const bool wrong_depth : {false, true}) {
    for (size_t bad = 0; bad < 5; ++bad) {
      std::vector<Sighting> sightings;
      for (const double x : {-0.5, -0.25, 0.0, 0.25, 0.5})
        sightings.push_back(See({x, 0, 0}, point));
      sightings[bad] = wrong_depth ? See(sightings[bad].centre, point, 1.7)
                                   : See(sightings[bad].centre, {1.0, 1.0, 3.0});
      const auto estimate = EstimatePoint(sightings, kLimits);
      ASSERT_TRUE(estimate);
      EXPECT_LT((estimate->xyz - point).norm(), 1e-12);
      EXPECT_EQ(estimate->agreeing.size(), wrong_depth ? 5u : 4u);
    }
  }
}

TEST(EstimatePoint, RaysWithoutDepthTakePart) {
  const Eigen::Vector3d point(0.0, 0.0, 4.0);
  std::vector<Sighting> sightings = {See({0, 0, 0}, point, 1.04), See({-4, 0, 4}, point)};
  sightings[1].axis = Eigen::Vector3d::UnitX();
  sightings[1].range = std::nan("");
  const auto estimate = EstimatePoint(sightings, kLimits);
  ASSERT_TRUE(estimate);
  EXPECT_LT((estimate->xyz - point).norm(), 0.01 * 0.16);
  sightings[0].range = std::nan("");
  EXPECT_FALSE(EstimatePoint(sightings, kLimits)) << "no depth at all";
}

TEST(EstimatePoint, IsUnknownWithoutAgreement) {
  const Eigen::Vector3d point(0.0, 0.0, 4.0);
  EXPECT_FALSE(EstimatePoint({}, kLimits));
  EXPECT_FALSE(EstimatePoint(std::vector{See({0, 0, 0}, point)}, kLimits));
  // Depths that contradict each other, and rays that hardly meet at an angle.
  EXPECT_FALSE(
      EstimatePoint(std::vector{See({0, 0, 0}, point), See({0.01, 0, 0}, point, 1.5)}, kLimits));
  // Rays that pass each other.
  EXPECT_FALSE(
      EstimatePoint(std::vector{See({0, 0, 0}, point), See({0, 0.5, 0}, {0, 1.5, 4.0})}, kLimits));
  // A point behind the second camera.
  std::vector<Sighting> sightings = {See({0, 0, 0}, point), See({0, 0, 5}, point)};
  EXPECT_FALSE(EstimatePoint(sightings, kLimits));
  sightings[1].axis = -Eigen::Vector3d::UnitZ();
  EXPECT_TRUE(EstimatePoint(sightings, kLimits));
}

TEST(EstimatePoint, SurvivesWhatIsNotFinite) {
  const Eigen::Vector3d point(0.0, 0.0, 4.0);
  std::vector<Sighting> sightings = {See({0, 0, 0}, point), See({1, 0, 0}, point)};
  Sighting broken = See({-1, 0, 0}, point);
  broken.centre.x() = std::nan("");
  sightings.insert(sightings.begin(), broken);
  const auto estimate = EstimatePoint(sightings, kLimits);
  ASSERT_TRUE(estimate);
  EXPECT_THAT(estimate->agreeing, ElementsAre(1, 2));
  EXPECT_LT((estimate->xyz - point).norm(), 1e-12);
}

// sigma is the rms of the true distance, for Gaussian errors of the size that is assumed.
TEST(EstimatePoint, SigmaIsTheError) {
  RandomStream random(HashKey({41}));
  double sum_of_squares = 0.0;
  constexpr int kNumTrials = 2000;
  for (int trial = 0; trial < kNumTrials; ++trial) {
    const Eigen::Vector3d point = 0.5 * random.NormalVector() + Eigen::Vector3d(0.0, 0.0, 6.0);
    std::vector<Sighting> sightings;
    for (const double x : {-1.0, -0.3, 0.4, 1.0}) {
      const Eigen::Vector3d centre(x, 0.2 * random.Normal(), 0.0);
      const double range = (point - centre).norm();
      const Eigen::Vector3d noise = kLimits.ray_sigma_rad * range * random.NormalVector();
      Sighting sighting = See(centre, point + noise);
      sighting.range = range * (1.0 + 0.02 * random.Normal());
      sightings.push_back(sighting);
    }
    const auto estimate = EstimatePoint(sightings, kLimits);
    if (!estimate) continue;
    const double ratio = (estimate->xyz - point).norm() / estimate->sigma;
    sum_of_squares += ratio * ratio;
  }
  // 2000 trials: 2 %. Tukey's loss at 3 sigma costs some 10 % of accuracy.
  EXPECT_NEAR(std::sqrt(sum_of_squares / kNumTrials), 1.0, 0.12);
}

}  // namespace
}  // namespace vgtw
