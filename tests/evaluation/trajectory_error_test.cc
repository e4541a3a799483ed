// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trajectory_error.h"

#include "tests/evaluation/golden_cases.h"

#include <cmath>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

const std::map<std::string, PoseAlignment> kAlignments = {{"none", PoseAlignment::kNone},
                                                          {"first", PoseAlignment::kFirstCamera},
                                                          {"se3", PoseAlignment::kSE3},
                                                          {"sim3", PoseAlignment::kSim3}};

void ExpectNear(const ErrorStatistics& actual,
                const nlohmann::json& expected,
                const std::string& what) {
  const auto expect = [&](double value, const char* key) {
    EXPECT_NEAR(value, expected[key], GoldenTolerance(expected[key])) << what << " " << key;
  };
  expect(actual.rmse, "rmse");
  expect(actual.mean, "mean");
  expect(actual.median, "median");
  expect(actual.max, "max");
}

TEST(TrajectoryError, AgreesWithEvo) {
  const nlohmann::json cases = ReadGolden("evo_trajectories")["cases"];
  for (const auto& [case_name, golden] : cases.items()) {
    const std::vector<NamedPose> estimate = PosesOf(golden["estimate"]);
    const std::vector<NamedPose> reference = PosesOf(golden["reference"]);
    for (const auto& [name, type] : kAlignments) {
      const auto comparison = ComparePoses(estimate, reference, {.type = type});
      ASSERT_TRUE(comparison);
      const nlohmann::json& expected = golden["evo"][name];
      const std::string what = case_name + " " + name;
      ExpectNear(ComputeAte(comparison->views), expected["ate"], what + " ATE");
      for (const nlohmann::json& rpe : expected["rpe"]) {
        const auto actual =
            ComputeRpe(comparison->views, {.delta = rpe["delta"], .all_pairs = rpe["all_pairs"]});
        ASSERT_TRUE(actual);
        EXPECT_EQ(actual->num_pairs, rpe["num_pairs"]);
        ExpectNear(actual->translation, rpe["translation"], what + " RPE translation");
        ExpectNear(actual->rotation_deg, rpe["rotation_deg"], what + " RPE rotation");
      }
    }
  }
}

// Cameras along x, one unit apart, all looking the same way.
std::vector<NamedPose> Row(size_t n) {
  std::vector<NamedPose> poses;
  for (size_t i = 0; i < n; ++i) {
    const auto x = static_cast<double>(i);
    poses.push_back({"v" + std::to_string(i), {Eigen::Quaterniond::Identity(), {-x, 0, 0}}});
  }
  return poses;
}

TEST(TrajectoryError, RpeOfOneTurnedCameraByHand) {
  const std::vector<NamedPose> reference = Row(4);
  std::vector<NamedPose> estimate = reference;
  // Camera 1 turns by 90 deg about its own centre.
  Rigid3d& turned = estimate[1].cam_from_world;
  turned.rotation = RotationAboutAxis({0, 0, 1}, 90.0);
  turned.translation = -(turned.rotation * Eigen::Vector3d(1, 0, 0));
  const auto comparison = ComparePoses(estimate, reference, {.type = PoseAlignment::kNone});
  ASSERT_TRUE(comparison);
  EXPECT_NEAR(ComputeAte(comparison->views).max, 0.0, 1e-15);
  const auto rpe = ComputeRpe(comparison->views);
  ASSERT_TRUE(rpe);
  EXPECT_EQ(rpe->num_pairs, 3u);
  // Pairs 0-1 and 1-2 are turned; only in 1-2 is the step seen from the turned camera: sqrt(2) off.
  EXPECT_NEAR(rpe->rotation_deg.mean, 60.0, 1e-12);
  EXPECT_NEAR(rpe->rotation_deg.rmse, 90.0 * std::sqrt(2.0 / 3.0), 1e-12);
  EXPECT_NEAR(rpe->translation.max, std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(rpe->translation.rmse, std::sqrt(2.0 / 3.0), 1e-12);
}

TEST(TrajectoryError, RpeDependsOnTheOrder) {
  const std::vector<NamedPose> reference = Row(4);
  std::vector<NamedPose> estimate = reference;
  estimate[3].cam_from_world.translation.x() -= 1.0;
  const auto rpe_of = [&](const std::vector<NamedPose>& in_order) {
    const auto comparison = ComparePoses(estimate, in_order, {.type = PoseAlignment::kNone});
    return ComputeRpe(comparison->views)->translation.mean;
  };
  EXPECT_NEAR(rpe_of(reference), 1.0 / 3.0, 1e-12);  // at the end it is in one pair
  EXPECT_NEAR(rpe_of({reference[0], reference[3], reference[1], reference[2]}), 2.0 / 3.0, 1e-12);
}

TEST(TrajectoryError, PairsAreDeltaApart) {
  const std::vector<NamedPose> poses = Row(7);
  const auto views = ComparePoses(poses, poses, {.type = PoseAlignment::kNone})->views;
  EXPECT_EQ(ComputeRpe(views, {.delta = 2})->num_pairs, 5u);
  EXPECT_EQ(ComputeRpe(views, {.delta = 2, .all_pairs = false})->num_pairs, 3u);
  EXPECT_EQ(ComputeRpe(views, {.delta = 6})->num_pairs, 1u);
  EXPECT_FALSE(ComputeRpe(views, {.delta = 7}));
  EXPECT_THROW(ComputeRpe(views, {.delta = 0}), std::invalid_argument);
}

TEST(TrajectoryError, StatisticsByHand) {
  const ErrorStatistics statistics = ComputeErrorStatistics({1.0, 7.0, 1.0, 3.0});
  EXPECT_NEAR(statistics.rmse, std::sqrt(15.0), 1e-12);
  EXPECT_EQ(statistics.mean, 3.0);
  EXPECT_EQ(statistics.median, 2.0);
  EXPECT_EQ(statistics.max, 7.0);
  EXPECT_THROW(ComputeErrorStatistics({}), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
