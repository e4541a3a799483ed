// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_alignment.h"

#include "scene/random.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr Eigen::Index kNumViews = 20;

std::vector<Rigid3d> RandomPoses(uint64_t seed) {
  RandomStream random(seed);
  std::vector<Rigid3d> poses;
  for (Eigen::Index i = 0; i < kNumViews; ++i) {
    poses.push_back({random.Rotation(), random.NormalVector()});
  }
  return poses;
}

std::vector<Rigid3d> Moved(const Sim3d& b_from_a, std::vector<Rigid3d> poses) {
  for (Rigid3d& pose : poses) pose = TransformCamera(b_from_a, pose);
  return poses;
}

const Sim3d kSimilarity = {2.5, RotationAboutAxis({0.6, 0.8, 0.0}, 70.0), {1.0, -2.0, 3.0}};

void ExpectNear(const Sim3d& actual, const Sim3d& expected) {
  // Rounding of numbers of size 10.
  EXPECT_NEAR(actual.scale, expected.scale, 1e-12);
  EXPECT_LT(AngleBetweenDeg(actual.rotation, expected.rotation), 1e-11);
  EXPECT_LT((actual.translation - expected.translation).norm(), 1e-12);
}

TEST(AlignPoses, Sim3UndoesASimilarity) {
  const std::vector<Rigid3d> estimate = RandomPoses(1);
  const auto aligned = AlignPoses(estimate, Moved(kSimilarity, estimate));
  ASSERT_TRUE(aligned);
  ExpectNear(aligned->reference_from_estimate, kSimilarity);
}

TEST(AlignPoses, SE3UndoesARigidMotionAndKeepsScale) {
  const std::vector<Rigid3d> estimate = RandomPoses(2);
  const Sim3d rigid = {1.0, kSimilarity.rotation, kSimilarity.translation};
  const auto aligned = AlignPoses(estimate, Moved(rigid, estimate), {.type = PoseAlignment::kSE3});
  ASSERT_TRUE(aligned);
  ExpectNear(aligned->reference_from_estimate, rigid);
  const auto scaled =
      AlignPoses(estimate, Moved(kSimilarity, estimate), {.type = PoseAlignment::kSE3});
  ASSERT_TRUE(scaled);
  EXPECT_EQ(scaled->reference_from_estimate.scale, 1.0);
  EXPECT_LT(AngleBetweenDeg(scaled->reference_from_estimate.rotation, kSimilarity.rotation), 1e-11);
}

TEST(AlignPoses, FirstCameraBecomesExact) {
  const std::vector<Rigid3d> estimate = RandomPoses(3);
  const std::vector<Rigid3d> reference = RandomPoses(4);
  const auto aligned = AlignPoses(estimate, reference, {.type = PoseAlignment::kFirstCamera});
  ASSERT_TRUE(aligned);
  const Rigid3d first = TransformCamera(aligned->reference_from_estimate, estimate[0]);
  EXPECT_LT(AngleBetweenDeg(first.rotation, reference[0].rotation), 1e-12);
  EXPECT_LT((first.translation - reference[0].translation).norm(), 1e-13);
  EXPECT_EQ(aligned->reference_from_estimate.scale, 1.0);
}

TEST(AlignPoses, NoneChangesNothing) {
  const auto aligned = AlignPoses(RandomPoses(3), RandomPoses(4), {.type = PoseAlignment::kNone});
  ASSERT_TRUE(aligned);
  ExpectNear(aligned->reference_from_estimate, Sim3d());
}

TEST(AlignPoses, RobustIsUnaffectedByGrossOutliers) {
  for (const PoseAlignment type : {PoseAlignment::kSE3, PoseAlignment::kSim3}) {
    Sim3d truth = kSimilarity;
    if (type == PoseAlignment::kSE3) truth.scale = 1.0;
    const std::vector<Rigid3d> estimate = RandomPoses(5);
    std::vector<Rigid3d> reference = Moved(truth, estimate);
    for (size_t i = 0; i < 6; ++i) reference[3 * i].translation += Eigen::Vector3d(10, 20, -30);
    const auto robust = AlignPoses(estimate, reference, {.type = type, .robust = true});
    ASSERT_TRUE(robust);
    ExpectNear(robust->reference_from_estimate, truth);
    for (size_t i = 0; i < reference.size(); ++i) {
      EXPECT_EQ(robust->is_inlier[i], i % 3 != 0 || i >= 18) << i;
    }
    const auto plain = AlignPoses(estimate, reference, {.type = type});
    ASSERT_TRUE(plain);
    EXPECT_GT(AngleBetweenDeg(plain->reference_from_estimate.rotation, truth.rotation), 1.0);
  }
}

TEST(AlignPoses, UndeterminedMotionsHaveNoResult) {
  std::vector<Rigid3d> line;
  for (int i = 0; i < 5; ++i) {
    line.push_back({Eigen::Quaterniond::Identity(), Eigen::Vector3d(i, 2.0 * i, 0.0)});
  }
  for (const bool robust : {false, true}) {
    EXPECT_FALSE(AlignPoses(line, line, {.type = PoseAlignment::kSim3, .robust = robust}));
    EXPECT_FALSE(AlignPoses(line, line, {.type = PoseAlignment::kSE3, .robust = robust}));
  }
  EXPECT_TRUE(AlignPoses(line, line, {.type = PoseAlignment::kFirstCamera}));
  EXPECT_FALSE(AlignPoses({}, {}, {.type = PoseAlignment::kFirstCamera}));
}

TEST(AlignPoses, OnlyEstimatedAlignmentsCanBeRobust) {
  const std::vector<Rigid3d> poses = RandomPoses(6);
  EXPECT_THROW(AlignPoses(poses, poses, {.type = PoseAlignment::kNone, .robust = true}),
               std::invalid_argument);
  EXPECT_EQ(AlignmentText({.type = PoseAlignment::kSE3, .robust = true}), "robustly SE3-aligned");
  EXPECT_EQ(AlignmentText({.type = PoseAlignment::kNone}), "not aligned");
}

}  // namespace
}  // namespace vgtw
