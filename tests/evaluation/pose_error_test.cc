// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_error.h"

#include "tests/evaluation/golden_cases.h"

#include <cmath>
#include <map>
#include <random>
#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Poses = std::map<std::string, Rigid3d>;

Rigid3d AtCentre(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& centre) {
  return {rotation, -(rotation * centre)};
}

Poses RandomPoses(int num_views, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Poses poses;
  for (int i = 0; i < num_views; ++i) {
    const Eigen::Quaterniond rotation =
        Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
            .normalized();
    poses["view" + std::to_string(i)] =
        AtCentre(rotation, Eigen::Vector3d(normal(random), normal(random), normal(random)));
  }
  return poses;
}

// Four cameras with identity rotation on the corners of a 2 x 2 square.
Poses SquareOfCameras() {
  const Eigen::Quaterniond identity = Eigen::Quaterniond::Identity();
  return {{"a", AtCentre(identity, {1, 1, 0})},
          {"b", AtCentre(identity, {-1, 1, 0})},
          {"c", AtCentre(identity, {-1, -1, 0})},
          {"d", AtCentre(identity, {1, -1, 0})}};
}

Poses Moved(const Sim3d& to_from_from, const Poses& poses) {
  Poses moved;
  for (const auto& [name, pose] : poses) moved[name] = TransformCamera(to_from_from, pose);
  return moved;
}

TEST(ComparePoses, EqualPosesHaveNoError) {
  const Poses poses = RandomPoses(6, 1);
  const auto comparison = ComparePoses(poses, poses);
  ASSERT_TRUE(comparison);
  // Rounding of unit-sized quantities.
  EXPECT_LT(comparison->centre_rmse, 1e-13);
  EXPECT_LT(comparison->rotation_mean_deg, 1e-12);
  EXPECT_LT(comparison->relative_rotation_median_deg, 1e-12);
  EXPECT_LT(comparison->relative_direction_median_deg, 1e-12);
  EXPECT_TRUE(comparison->missing.empty());
  EXPECT_EQ(comparison->views.size(), 6u);
  EXPECT_EQ(comparison->views.front().name, "view0");
}

TEST(ComparePoses, FiguresOfOneShiftedAndOneTurnedCamera) {
  const Poses reference = SquareOfCameras();
  Poses estimate = reference;
  // Out of the square's plane alternately: such a pattern is orthogonal to every similarity of the
  // square, so that the alignment stays the identity up to scale.
  const double offset = 0.1;
  const double angle_deg = 8.0;
  for (const char* name : {"a", "c"}) {
    estimate[name] = AtCentre(estimate[name].rotation,
                              OriginInSource(estimate[name]) + Eigen::Vector3d(0, 0, offset));
  }
  for (const char* name : {"b", "d"}) {
    estimate[name] = AtCentre(estimate[name].rotation,
                              OriginInSource(estimate[name]) - Eigen::Vector3d(0, 0, offset));
  }
  estimate["b"] = AtCentre(RotationAboutAxis({0, 0, 1}, angle_deg), OriginInSource(estimate["b"]));
  const auto comparison = ComparePoses(estimate, reference);
  ASSERT_TRUE(comparison);

  // Umeyama's scale: <ref, est> / <est, est> = 8 / (8 + 4 offset^2).
  const double scale = 8.0 / (8.0 + 4.0 * offset * offset);
  EXPECT_NEAR(comparison->reference_from_estimate.scale, scale, 1e-12);
  const double squared = 2.0 * (1.0 - scale) * (1.0 - scale) + scale * scale * offset * offset;
  EXPECT_NEAR(comparison->centre_rmse, std::sqrt(squared), 1e-12);
  EXPECT_NEAR(comparison->views[1].centre, std::sqrt(squared), 1e-12);
  EXPECT_NEAR(comparison->extent, std::sqrt(8.0), 1e-12);
  EXPECT_NEAR(comparison->centre_rmse_percent, 100.0 * std::sqrt(squared / 8.0), 1e-10);

  EXPECT_NEAR(comparison->views[0].rotation_deg, 0.0, 1e-9);
  EXPECT_NEAR(comparison->views[1].rotation_deg, angle_deg, 1e-9);
  EXPECT_NEAR(comparison->rotation_mean_deg, angle_deg / 4.0, 1e-9);
  EXPECT_NEAR(comparison->rotation_median_deg, 0.0, 1e-9);
  // Three of six pairs contain b: half zeros, half angle.
  EXPECT_NEAR(comparison->relative_rotation_median_deg, angle_deg / 2.0, 1e-9);
}

TEST(ComparePoses, DirectionIsTakenInTheFirstCamerasFrame) {
  const Poses reference = SquareOfCameras();
  Poses estimate = reference;
  // Turning "a" changes the directions a->b, a->c, a->d; turning the last camera changes none.
  estimate["a"] = AtCentre(RotationAboutAxis({0, 0, 1}, 10.0), OriginInSource(estimate["a"]));
  EXPECT_NEAR(ComparePoses(estimate, reference)->relative_direction_median_deg, 5.0, 1e-9);
  estimate = reference;
  estimate["d"] = AtCentre(RotationAboutAxis({0, 0, 1}, 10.0), OriginInSource(estimate["d"]));
  EXPECT_NEAR(ComparePoses(estimate, reference)->relative_direction_median_deg, 0.0, 1e-9);
}

TEST(ComparePoses, ASimilarityOfTheEstimateChangesNothing) {
  const Poses reference = RandomPoses(8, 2);
  Poses estimate = RandomPoses(8, 3);  // far off: every figure is large
  const Sim3d similarity = {3.7, RotationAboutAxis({0, 0.6, 0.8}, 77.0), {5.0, -2.0, 11.0}};
  const auto before = ComparePoses(estimate, reference);
  const auto after = ComparePoses(Moved(similarity, estimate), reference);
  ASSERT_TRUE(before);
  ASSERT_TRUE(after);
  // Rounding, amplified by the size of the similarity.
  EXPECT_NEAR(after->centre_rmse, before->centre_rmse, 1e-11);
  EXPECT_NEAR(after->centre_rmse_percent, before->centre_rmse_percent, 1e-9);
  EXPECT_NEAR(after->rotation_mean_deg, before->rotation_mean_deg, 1e-9);
  EXPECT_NEAR(after->relative_rotation_median_deg, before->relative_rotation_median_deg, 1e-9);
  EXPECT_NEAR(after->relative_direction_median_deg, before->relative_direction_median_deg, 1e-9);
  EXPECT_GT(before->relative_direction_median_deg, 10.0);
}

TEST(ComparePoses, CountsViewsThatTheEstimateLacks) {
  const Poses reference = RandomPoses(6, 4);
  Poses estimate = reference;
  estimate.erase("view2");
  estimate.erase("view5");
  estimate["elsewhere"] = Rigid3d();
  const auto comparison = ComparePoses(estimate, reference);
  ASSERT_TRUE(comparison);
  EXPECT_EQ(comparison->missing, (std::vector<std::string>{"view2", "view5"}));
  ASSERT_EQ(comparison->views.size(), 4u);
  EXPECT_EQ(comparison->views[2].name, "view3");
  EXPECT_EQ(comparison->extent, ComparePoses(reference, reference)->extent);
}

TEST(ComparePoses, PairsInOnePlaceHaveNoDirection) {
  Poses reference = SquareOfCameras();
  reference["e"] = reference["a"];
  Poses estimate = reference;
  estimate["e"].rotation = RotationAboutAxis({1, 0, 0}, 3.0);
  estimate["e"].translation = -(estimate["e"].rotation * Eigen::Vector3d(1, 1, 0));
  const auto comparison = ComparePoses(estimate, reference);
  ASSERT_TRUE(comparison);
  EXPECT_NEAR(comparison->relative_direction_median_deg, 0.0, 1e-9);
  EXPECT_NEAR(comparison->rotation_mean_deg, 3.0 / 5.0, 1e-9);
}

TEST(ComparePoses, IsUndeterminedForTwoViewsAndForCollinearCentres) {
  Poses two = SquareOfCameras();
  two.erase("c");
  two.erase("d");
  EXPECT_FALSE(ComparePoses(two, two));
  EXPECT_FALSE(ComparePoses({}, SquareOfCameras()));

  Poses line;
  for (int i = 0; i < 5; ++i) {
    line["view" + std::to_string(i)] =
        AtCentre(Eigen::Quaterniond::Identity(), Eigen::Vector3d(i, 2.0 * i, 0.0));
  }
  EXPECT_FALSE(ComparePoses(line, line));
}

TEST(ComparePoses, TurningOneViewShowsInItsRelativeRotationOnly) {
  const Poses reference = RandomPoses(7, 3);
  Poses estimate = reference;
  Rigid3d& turned = estimate["view2"];
  turned = AtCentre(RotationAboutAxis(Eigen::Vector3d::UnitX(), 5.0) * turned.rotation,
                    OriginInSource(turned));
  const auto comparison = ComparePoses(estimate, reference);
  ASSERT_TRUE(comparison);
  for (const ViewPoseError& view : comparison->views) {
    // Every other view has one bad pair of six: the median does not see it.
    EXPECT_NEAR(view.relative_rotation_deg, view.name == "view2" ? 5.0 : 0.0, 1e-9) << view.name;
  }
}

TEST(ComparePoses, ErrorsOfViewsAgreeWithSciPy) {
  const nlohmann::json trajectories = ReadGolden("evo_trajectories")["cases"];
  const nlohmann::json cases = ReadGolden("pair_accuracy")["cases"];
  for (const auto& [name, golden] : cases.items()) {
    const auto comparison = ComparePoses(PosesOf(trajectories[name]["estimate"]),
                                         PosesOf(trajectories[name]["reference"]));
    ASSERT_TRUE(comparison);
    const nlohmann::json& expected = golden["views"];
    EXPECT_NEAR(comparison->reference_from_estimate.scale, expected["scale"], 1e-9);
    for (size_t i = 0; i < comparison->views.size(); ++i) {
      EXPECT_NEAR(comparison->views[i].centre, expected["centre"][i], 1e-9) << name;
      EXPECT_NEAR(comparison->views[i].rotation_deg, expected["rotation_deg"][i], 1e-9) << name;
    }
  }
}

TEST(ComparePoses, RigidMotionsOfTheEstimateChangeNothingUnlessUnaligned) {
  const Poses reference = RandomPoses(8, 5);
  const Poses estimate = RandomPoses(8, 6);
  const Sim3d rigid = {1.0, RotationAboutAxis({0, 0.6, 0.8}, 77.0), {5.0, -2.0, 11.0}};
  for (const PoseAlignment type :
       {PoseAlignment::kNone, PoseAlignment::kFirstCamera, PoseAlignment::kSE3}) {
    const auto before = ComparePoses(estimate, reference, {.type = type});
    const auto after = ComparePoses(Moved(rigid, estimate), reference, {.type = type});
    ASSERT_TRUE(before && after);
    const bool is_aligned = type != PoseAlignment::kNone;
    const double change = std::abs(after->centre_rmse - before->centre_rmse);
    EXPECT_TRUE(is_aligned ? change < 1e-11 : change > 1.0) << change;
  }
}

TEST(ComparePoses, FirstCameraOfTheReferencesOrderIsExact) {
  std::vector<NamedPose> reference;
  for (const auto& [name, pose] : RandomPoses(5, 7)) reference.push_back({name, pose});
  std::swap(reference[0], reference[3]);
  std::vector<NamedPose> estimate;
  for (const auto& [name, pose] : RandomPoses(5, 8)) estimate.push_back({name, pose});
  const auto comparison = ComparePoses(estimate, reference, {.type = PoseAlignment::kFirstCamera});
  ASSERT_TRUE(comparison);
  EXPECT_EQ(comparison->views[0].name, "view3");
  EXPECT_LT(comparison->views[0].centre, 1e-13);
  EXPECT_LT(comparison->views[0].rotation_deg, 1e-12);
  EXPECT_GT(comparison->views[1].centre, 0.1);
}

TEST(ComparePoses, RobustAlignmentLeavesErrorsToTheOutliers) {
  const Poses reference = RandomPoses(20, 9);
  Poses estimate = reference;
  for (const char* name : {"view2", "view5", "view7", "view11", "view13", "view19"}) {
    estimate[name].translation += Eigen::Vector3d(20, -30, 10);
  }
  const auto comparison = ComparePoses(estimate, reference, {.robust = true});
  ASSERT_TRUE(comparison);
  for (const ViewPoseError& view : comparison->views) {
    const bool is_moved = estimate[view.name].translation != reference.at(view.name).translation;
    EXPECT_EQ(view.is_inlier, !is_moved) << view.name;
    EXPECT_NEAR(view.centre, is_moved ? std::sqrt(1400.0) : 0.0, 1e-9) << view.name;
  }
}

TEST(ComparePoses, NamesAreUnique) {
  const std::vector<NamedPose> twice = {{"a", {}}, {"a", {}}};
  EXPECT_THROW(ComparePoses(twice, twice), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
