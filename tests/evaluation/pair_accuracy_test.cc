// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pair_accuracy.h"

#include "scene/random.h"
#include "scene/sim3d.h"
#include "tests/evaluation/golden_cases.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Rigid3d> RandomPoses(size_t n, uint64_t seed) {
  RandomStream random(seed);
  std::vector<Rigid3d> poses;
  for (size_t i = 0; i < n; ++i) poses.push_back({random.Rotation(), random.NormalVector()});
  return poses;
}

std::vector<Rigid3d> WithoutNames(const std::vector<NamedPose>& named) {
  std::vector<Rigid3d> poses;
  for (const NamedPose& pose : named) poses.push_back(pose.cam_from_world);
  return poses;
}

TEST(PairAccuracy, AgreesWithNumPyAndSciPy) {
  const nlohmann::json trajectories = ReadGolden("evo_trajectories")["cases"];
  const nlohmann::json cases = ReadGolden("pair_accuracy")["cases"];
  for (const auto& [name, golden] : cases.items()) {
    const auto errors = ComputePairErrors(WithoutNames(PosesOf(trajectories[name]["estimate"])),
                                          WithoutNames(PosesOf(trajectories[name]["reference"])));
    ASSERT_EQ(errors.size(), golden["rotation_deg"].size());
    for (size_t i = 0; i < errors.size(); ++i) {
      EXPECT_NEAR(errors[i].rotation_deg, golden["rotation_deg"][i], 1e-9);
      EXPECT_NEAR(errors[i].direction_deg, golden["direction_deg"][i], 1e-9);
    }
    for (const nlohmann::json& expected : golden["accuracy"]) {
      const PairAccuracy accuracy = ComputePairAccuracy(errors, expected["threshold_deg"]);
      EXPECT_EQ(accuracy.rotation, expected["rra"]) << name;
      EXPECT_EQ(accuracy.direction, expected["rta"]) << name;
      EXPECT_NEAR(accuracy.auc_histogram, expected["auc_histogram"], 1e-9) << name;
      EXPECT_NEAR(accuracy.auc_trapezoid, expected["auc_trapezoid"], 1e-9) << name;
    }
  }
}

TEST(PairAccuracy, AucsOfExponentialErrorsAgreeWithNumPy) {
  const nlohmann::json golden = ReadGolden("pair_accuracy")["exponential"];
  const auto errors_deg = golden["errors_deg"].get<std::vector<double>>();
  for (const nlohmann::json& expected : golden["auc"]) {
    const int threshold_deg = expected["threshold_deg"];
    EXPECT_NEAR(AucHistogram(errors_deg, threshold_deg), expected["histogram"], 1e-9);
    EXPECT_NEAR(AucTrapezoid(errors_deg, threshold_deg), expected["trapezoid"], 1e-9);
  }
}

TEST(PairAccuracy, DefinitionsOfAucDisagreeOnHalfADegree) {
  const std::vector<double> errors_deg(45, 0.5);  // pairs of 10 views
  EXPECT_EQ(AucHistogram(errors_deg, 3), 1.0);
  // A triangle up to the first error, then a rise to 1, of height 1/45 and 1.
  EXPECT_NEAR(AucTrapezoid(errors_deg, 3.0), (0.5 * 0.5 / 45.0 + 2.5) / 3.0, 1e-12);
  EXPECT_NEAR(AucTrapezoid(errors_deg, 3.0), 0.835, 5e-4);
}

TEST(PairAccuracy, AucsByHand) {
  const std::vector<double> errors_deg = {0.2, 1.0, 2.5, 9.0};
  // Bins [0,1) [1,2) [2,3]: cumulative 1/4, 2/4, 3/4.
  EXPECT_NEAR(AucHistogram(errors_deg, 3), (0.25 + 0.5 + 0.75) / 3.0, 1e-12);
  const double area = 0.2 * 0.125 + 0.8 * 0.375 + 1.5 * 0.625 + 0.5 * 0.75;
  EXPECT_NEAR(AucTrapezoid(errors_deg, 3.0), area / 3.0, 1e-12);
  // The upper edge of the last bin belongs to it, no other edge does.
  EXPECT_EQ(AucHistogram({3.0}, 3), 1.0 / 3.0);
  EXPECT_EQ(AucHistogram({2.0}, 3), 1.0 / 3.0);
  EXPECT_EQ(AucTrapezoid({3.0}, 3.0), 0.5);
  EXPECT_TRUE(std::isnan(AucHistogram({}, 3)));
  EXPECT_TRUE(std::isnan(AucTrapezoid({}, 3.0)));
}

TEST(PairAccuracy, AucsLieBetweenNothingAndEverything) {
  RandomStream random(3);
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<double> errors_deg;
    for (int i = 0; i < 30; ++i) errors_deg.push_back(std::exp(3.0 * random.Normal()));
    double last = 0.0;
    for (const int threshold_deg : {1, 3, 5, 10, 30}) {
      const double histogram = AucHistogram(errors_deg, threshold_deg);
      const double trapezoid = AucTrapezoid(errors_deg, threshold_deg);
      EXPECT_GE(trapezoid, 0.0);
      EXPECT_LE(histogram, 1.0);
      // A bin counts whole for the errors in it. The curve counts them from there on, but rises to
      // each on a slope, whose triangles add up to at most half a step.
      EXPECT_GE(histogram, trapezoid - 0.5 / 30.0);
      EXPECT_GE(histogram, last);  // the share of right pairs only grows
      last = histogram;
    }
  }
  EXPECT_EQ(AucHistogram({0.0, 0.0}, 1), 1.0);
  EXPECT_EQ(AucTrapezoid({0.0, 0.0}, 1.0), 1.0);
  EXPECT_EQ(AucHistogram({kInfinity}, 30), 0.0);
  EXPECT_EQ(AucTrapezoid({kInfinity}, 30.0), 0.0);
}

TEST(PairAccuracy, SimilaritiesOfTheEstimateChangeNothing) {
  const std::vector<Rigid3d> reference = RandomPoses(6, 1);
  std::vector<Rigid3d> estimate = RandomPoses(6, 2);
  const auto before = ComputePairErrors(estimate, reference);
  const Sim3d similarity = {0.3, RotationAboutAxis({0.6, 0, 0.8}, 100.0), {4.0, 5.0, -6.0}};
  for (Rigid3d& pose : estimate) pose = TransformCamera(similarity, pose);
  const auto after = ComputePairErrors(estimate, reference);
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(after[i].rotation_deg, before[i].rotation_deg, 1e-10);
    EXPECT_NEAR(after[i].direction_deg, before[i].direction_deg, 1e-10);
  }
}

TEST(PairAccuracy, OppositeDirectionsAreRightForTheHistogramOnly) {
  // Two cameras that look the same way; the estimate has the second on the other side.
  const std::vector<Rigid3d> reference = {{}, {Eigen::Quaterniond::Identity(), {1, 0, 0}}};
  const std::vector<Rigid3d> estimate = {{}, {Eigen::Quaterniond::Identity(), {-2, 0, 0}}};
  const auto errors = ComputePairErrors(estimate, reference);
  EXPECT_NEAR(errors.at(0).direction_deg, 180.0, 1e-12);
  const PairAccuracy accuracy = ComputePairAccuracy(errors, 5);
  EXPECT_EQ(accuracy.direction, 1.0);
  EXPECT_EQ(accuracy.auc_histogram, 1.0);
  EXPECT_EQ(accuracy.auc_trapezoid, 0.0);
}

TEST(PairAccuracy, PairsWithoutDirectionCountByRotation) {
  const std::vector<Rigid3d> poses = {{}, {}, {Eigen::Quaterniond::Identity(), {1, 0, 0}}};
  const auto errors = ComputePairErrors(poses, poses);
  EXPECT_TRUE(std::isnan(errors.at(0).direction_deg));
  const PairAccuracy accuracy = ComputePairAccuracy(errors, 3);
  EXPECT_EQ(accuracy.rotation, 1.0);
  EXPECT_EQ(accuracy.direction, 1.0);
  EXPECT_EQ(accuracy.auc_trapezoid, 1.0);
}

TEST(PairAccuracy, MissingPairsCountAsWrong) {
  const std::vector<Rigid3d> poses = RandomPoses(3, 5);
  const PairAccuracy accuracy = ComputePairAccuracy(ComputePairErrors(poses, poses), 5, 1);
  EXPECT_EQ(accuracy.rotation, 0.75);
  EXPECT_EQ(accuracy.direction, 0.75);
  EXPECT_EQ(accuracy.auc_histogram, 0.75);
  EXPECT_NEAR(accuracy.auc_trapezoid, 0.75, 1e-12);
  EXPECT_THROW(ComputePairAccuracy({}, 0), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
