// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/cloud_error.h"

#include "evaluation/voxel_mean.h"
#include "scene/sim3d.h"
#include "tests/evaluation/made_clouds.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// "Agreement to 1e-6 relative for clouds."
constexpr double kGoldenTolerance = 1e-6;

void ExpectNear(double value, const nlohmann::json& golden) {
  const auto expected = golden.get<double>();
  EXPECT_NEAR(value, expected, kGoldenTolerance * std::abs(expected));
}

void ExpectGolden(const DirectedCloudError& error, const nlohmann::json& golden) {
  ExpectNear(error.mean, golden["mean"]);
  ExpectNear(error.median, golden["median"]);
  ExpectNear(error.share_within_f_distance, golden["share"]);
  ExpectNear(error.normal_mean, golden["normal_mean"]);
  ExpectNear(error.normal_median, golden["normal_median"]);
  EXPECT_EQ(error.num_clipped, golden["num_clipped"].get<size_t>());
}

void ExpectGolden(const CloudError& error, const nlohmann::json& golden) {
  ExpectGolden(error.accuracy, golden["accuracy"]);
  ExpectGolden(error.completeness, golden["completeness"]);
  ExpectNear(error.Overall(), golden["overall"]);
  ExpectNear(error.NormalConsistencyMean(), golden["normal_mean"]);
  ExpectNear(error.NormalConsistencyMedian(), golden["normal_median"]);
  ExpectNear(error.F(), golden["f"]);
}

TEST(CompareClouds, EqualsScipy) {
  const nlohmann::json golden = ReadGolden("cloud_error");
  const Points prediction = MadePrediction();
  const Points reference = MadeReference();
  ExpectGolden(CompareClouds(prediction, reference), golden["plain"]);
  CloudErrorOptions clipped;
  clipped.clip_distance = 0.2;
  clipped.f_distance = 0.1;
  ExpectGolden(CompareClouds(prediction, reference, clipped), golden["clipped"]);
  const Points prediction_voxels = MeanInVoxels(prediction, 0.3);
  const Points reference_voxels = MeanInVoxels(reference, 0.3);
  EXPECT_EQ(prediction_voxels.size(), golden["voxels"]["num_prediction"].get<size_t>());
  EXPECT_EQ(reference_voxels.size(), golden["voxels"]["num_reference"].get<size_t>());
  CloudErrorOptions wide;
  wide.f_distance = 0.1;
  ExpectGolden(CompareClouds(prediction_voxels, reference_voxels, wide), golden["voxels"]);
}

TEST(CompareClouds, EqualCloudsHaveNoErrorAndEqualNormals) {
  const CloudError error = CompareClouds(MadePrediction(), MadePrediction());
  for (const DirectedCloudError& directed : {error.accuracy, error.completeness}) {
    EXPECT_EQ(directed.mean, 0.0);
    EXPECT_EQ(directed.median, 0.0);
    EXPECT_EQ(directed.share_within_f_distance, 1.0);
    EXPECT_EQ(directed.num_normals, directed.num_points);
    // A unit vector's squared length, rounded.
    EXPECT_NEAR(directed.normal_mean, 1.0, 1e-14);
  }
  EXPECT_EQ(error.F(), 1.0);
}

// n x n points, 1 apart, in the plane z = `z`.
Points Square(int n, double z) {
  Points points;
  for (int i = 0; i < n * n; ++i) points.push_back(Eigen::Vector3d(i % n, i / n, z));
  return points;
}

TEST(CompareClouds, ShiftedPlaneHasTheErrorsCountedByHand) {
  // 10 x 10 points against 10 x 9 of them, 0.25 above: the outer column lies sqrt(1 + 1/16) away.
  const Points prediction = Square(10, 0.25);
  Points reference;
  for (const Eigen::Vector3d& point : Square(10, 0.0)) {
    if (point.x() < 9.0) reference.push_back(point);
  }
  CloudErrorOptions options;
  options.f_distance = 0.5;
  const CloudError error = CompareClouds(prediction, reference, options);
  EXPECT_NEAR(error.accuracy.mean, 0.9 * 0.25 + 0.1 * std::sqrt(1.0625), 1e-15);
  EXPECT_EQ(error.accuracy.median, 0.25);
  EXPECT_EQ(error.accuracy.share_within_f_distance, 0.9);
  EXPECT_EQ(error.completeness.mean, 0.25);
  EXPECT_EQ(error.completeness.share_within_f_distance, 1.0);
  EXPECT_EQ(error.Overall(), 0.5 * (error.accuracy.mean + 0.25));
  EXPECT_NEAR(error.F(), 1.8 / 1.9, 1e-15);
  EXPECT_NEAR(error.NormalConsistencyMean(), 1.0, 1e-14);
  options.clip_distance = 0.5;
  const CloudError clipped = CompareClouds(prediction, reference, options);
  EXPECT_NEAR(clipped.accuracy.mean, 0.9 * 0.25 + 0.1 * 0.5, 1e-15);
  EXPECT_EQ(clipped.accuracy.num_clipped, 10u);
}

TEST(CompareClouds, TiltedPlanesHaveTheCosineOfTheirAngle) {
  Points tilted = Square(12, 0.0);
  const Eigen::AngleAxisd turn(0.3, Eigen::Vector3d::UnitX());
  for (Eigen::Vector3d& point : tilted) point = turn * point;
  const CloudError error = CompareClouds(Square(12, 0.0), tilted);
  EXPECT_NEAR(error.accuracy.normal_mean, std::cos(0.3), 1e-14);
  EXPECT_NEAR(error.completeness.normal_median, std::cos(0.3), 1e-14);
}

TEST(CompareClouds, ExchangedCloudsExchangeAccuracyAndCompleteness) {
  const CloudError error = CompareClouds(MadePrediction(), MadeReference());
  const CloudError exchanged = CompareClouds(MadeReference(), MadePrediction());
  EXPECT_EQ(error.accuracy.mean, exchanged.completeness.mean);
  EXPECT_EQ(error.completeness.median, exchanged.accuracy.median);
  EXPECT_EQ(error.accuracy.normal_mean, exchanged.completeness.normal_mean);
  EXPECT_EQ(error.F(), exchanged.F());
}

TEST(CompareClouds, CommonSimilarityScalesDistancesAndLeavesNormals) {
  Points prediction = MadePrediction();
  Points reference = MadeReference();
  const CloudError before = CompareClouds(prediction, reference);
  const Sim3d motion = {3.0, Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {10.0, -20.0, 5.0}};
  for (Eigen::Vector3d& point : prediction) point = motion * point;
  for (Eigen::Vector3d& point : reference) point = motion * point;
  CloudErrorOptions options;
  options.f_distance = 3.0 * CloudErrorOptions().f_distance;
  const CloudError after = CompareClouds(prediction, reference, options);
  // Rounding of coordinates of about 30 against distances of about 0.1.
  EXPECT_NEAR(after.accuracy.mean, 3.0 * before.accuracy.mean, 1e-12);
  EXPECT_NEAR(after.completeness.median, 3.0 * before.completeness.median, 1e-12);
  EXPECT_EQ(after.F(), before.F());
  EXPECT_NEAR(after.NormalConsistencyMean(), before.NormalConsistencyMean(), 1e-10);
}

TEST(CompareClouds, PairsWithoutNormalsAreLeftOutOfTheirConsistency) {
  Points line;
  for (int i = 0; i < 50; ++i) line.push_back({double(i), 0.0, 0.0});
  const CloudError error = CompareClouds(line, Square(5, 0.0));
  EXPECT_EQ(error.accuracy.num_normals, 0u);
  EXPECT_TRUE(std::isnan(error.accuracy.normal_mean));
  EXPECT_TRUE(std::isnan(error.NormalConsistencyMedian()));
}

TEST(CompareClouds, RefusesEmptyCloudsAndOptionsOutOfRange) {
  EXPECT_THROW(CompareClouds({}, Square(2, 0.0)), std::invalid_argument);
  EXPECT_THROW(CompareClouds(Square(2, 0.0), {}), std::invalid_argument);
  CloudErrorOptions options;
  options.f_distance = 0.0;
  EXPECT_THROW(CompareClouds(Square(2, 0.0), Square(2, 0.0), options), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
