// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/pose_conventions.h"

#include "scene/random.h"
#include "scene/sim3d.h"

#include <algorithm>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::string NameOf(size_t i) { return "view" + std::to_string(100 + i); }

// Cameras around the origin that look at it from different heights.
std::vector<NamedPose> Ring(size_t num_views) {
  std::vector<NamedPose> poses;
  for (size_t i = 0; i < num_views; ++i) {
    const double angle = 4.5 * static_cast<double>(i) / static_cast<double>(num_views);
    const Eigen::Vector3d centre(
        3.0 * std::cos(angle), 0.5 * std::sin(5.0 * angle), 3.0 * std::sin(angle));
    poses.push_back({NameOf(i), LookAt(centre, {0, 0, 0}, {0, 1, 0})});
  }
  return poses;
}

// In another world, with errors of `noise_deg` and as many percent of the radius.
std::vector<NamedPose> Noisy(std::vector<NamedPose> poses, double noise_deg) {
  RandomStream random(2);
  const Sim3d similarity = {0.4, random.Rotation(), random.NormalVector()};
  for (NamedPose& pose : poses) {
    const Eigen::Vector3d axis = random.NormalVector().normalized();
    pose.cam_from_world.rotation =
        RotationAboutAxis(axis, noise_deg) * pose.cam_from_world.rotation;
    pose.cam_from_world.translation += 0.03 * noise_deg * random.NormalVector();
    pose.cam_from_world = TransformCamera(similarity, pose.cam_from_world);
  }
  return poses;
}

std::vector<NamedPose> Inverted(std::vector<NamedPose> poses) {
  for (NamedPose& pose : poses) pose.cam_from_world = Inverse(pose.cam_from_world);
  return poses;
}

std::vector<NamedPose> WithOpenGlAxes(std::vector<NamedPose> poses) {
  const Rigid3d turn = {RotationAboutAxis({1, 0, 0}, 180.0), {0, 0, 0}};
  for (NamedPose& pose : poses) pose.cam_from_world = turn * pose.cam_from_world;
  return poses;
}

TEST(FindBetterReading, FindsTheMistakeThroughNoise) {
  const std::vector<NamedPose> reference = Ring(12);
  const std::vector<NamedPose> estimate = Noisy(reference, 2.0);
  const auto inverted = FindBetterReading(
      Inverted(estimate), {WithOpenGlAxes(Inverted(estimate)), estimate}, reference);
  ASSERT_TRUE(inverted);
  EXPECT_EQ(inverted->idx, 1u);
  EXPECT_GT(inverted->error_as_read_deg, 30.0);
  EXPECT_LT(inverted->error_deg, 6.0);
  const auto opengl = FindBetterReading(
      WithOpenGlAxes(estimate), {Inverted(WithOpenGlAxes(estimate)), estimate}, reference);
  ASSERT_TRUE(opengl);
  EXPECT_EQ(opengl->idx, 1u);
}

TEST(FindBetterReading, GoodPosesAreLeftInPeace) {
  const std::vector<NamedPose> reference = Ring(12);
  for (const double noise_deg : {0.0, 0.5, 4.0}) {
    const std::vector<NamedPose> estimate = Noisy(reference, noise_deg);
    const std::vector<std::vector<NamedPose>> readings = {
        Inverted(estimate), WithOpenGlAxes(estimate), reference};
    // `reference` itself would be better than noise, but not by a mistake of conventions.
    EXPECT_EQ(FindBetterReading(estimate, readings, reference).has_value(), noise_deg == 4.0);
    EXPECT_FALSE(
        FindBetterReading(estimate, {Inverted(estimate), WithOpenGlAxes(estimate)}, reference));
  }
}

TEST(FindBetterReading, RandomPosesAreNoMistakeOfConventions) {
  RandomStream random(3);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<NamedPose> estimate = Ring(6);
    for (NamedPose& pose : estimate) {
      pose.cam_from_world = {random.Rotation(), random.NormalVector()};
    }
    EXPECT_FALSE(
        FindBetterReading(estimate, {Inverted(estimate), WithOpenGlAxes(estimate)}, Ring(6)));
    EXPECT_FALSE(FindShuffledNames(estimate, Ring(6)));
  }
}

TEST(FindBetterReading, ThePlainestOfEqualReadingsIsMeant) {
  const std::vector<NamedPose> reference = Ring(8);
  const std::vector<NamedPose> estimate = Noisy(reference, 1.0);
  const auto better = FindBetterReading(
      Inverted(estimate), {estimate, estimate, Noisy(reference, 0.95)}, reference);
  ASSERT_TRUE(better);
  EXPECT_EQ(better->idx, 0u);
}

TEST(FindBetterReading, ManyViewsAreSampled) {
  const std::vector<NamedPose> reference = Ring(300);
  const std::vector<NamedPose> estimate = Noisy(reference, 1.0);
  EXPECT_TRUE(FindBetterReading(Inverted(estimate), {estimate}, reference));
  EXPECT_FALSE(FindBetterReading({}, {{}}, reference));
}

TEST(FindShuffledNames, FindsThePermutationThroughNoise) {
  for (const size_t num_views : {size_t{4}, size_t{15}, size_t{60}}) {
    const std::vector<NamedPose> reference = Ring(num_views);
    std::vector<NamedPose> estimate = Noisy(reference, 1.0);
    // Names move on by a third of the ring.
    for (size_t i = 0; i < num_views; ++i) {
      estimate[i].name = NameOf((i + num_views / 3 + 1) % num_views);
    }
    const auto shuffled = FindShuffledNames(estimate, reference);
    ASSERT_TRUE(shuffled) << num_views;
    EXPECT_LT(shuffled->error_deg, 5.0);
    EXPECT_GT(shuffled->error_as_read_deg, 20.0);
    ASSERT_EQ(shuffled->exchanges.size(), num_views);
    for (size_t i = 0; i < num_views; ++i) {
      EXPECT_EQ(shuffled->exchanges[i].name_of_pose, NameOf(i));
      EXPECT_EQ(shuffled->exchanges[i].name, NameOf((i + num_views / 3 + 1) % num_views));
    }
  }
}

TEST(FindShuffledNames, OnlyExchangedViewsAreNamed) {
  const std::vector<NamedPose> reference = Ring(10);
  std::vector<NamedPose> estimate = Noisy(reference, 0.2);
  std::reverse(estimate.begin(), estimate.begin() + 8);
  for (size_t i = 0; i < 10; ++i) estimate[i].name = NameOf(i);
  const auto shuffled = FindShuffledNames(estimate, reference);
  ASSERT_TRUE(shuffled);
  EXPECT_EQ(shuffled->exchanges.size(), 8u);
  EXPECT_EQ(shuffled->exchanges[0].name, NameOf(7));
  EXPECT_EQ(shuffled->exchanges[0].name_of_pose, NameOf(0));
}

TEST(FindShuffledNames, GoodAndBadPosesInOrderAreNotShuffled) {
  const std::vector<NamedPose> reference = Ring(12);
  for (const double noise_deg : {0.0, 1.0, 10.0}) {
    EXPECT_FALSE(FindShuffledNames(Noisy(reference, noise_deg), reference)) << noise_deg;
  }
  EXPECT_FALSE(FindShuffledNames(Inverted(reference), reference));
}

}  // namespace
}  // namespace vgtw
