// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/icp.h"

#include "scene/random.h"
#include "scene/rigid3d.h"
#include "tests/evaluation/made_clouds.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

Points Moved(const Sim3d& motion, const Points& points) {
  Points moved;
  for (const Eigen::Vector3d& point : points) moved.push_back(motion * point);
  return moved;
}

Sim3d SmallMotion(double scale) {
  return {
      scale, RotationAboutAxis(Eigen::Vector3d(1.0, -2.0, 2.0) / 3.0, 1.0), {0.02, -0.03, 0.01}};
}

// The cloud that golden/cloud_error.py moves: every second point of the reference.
Points GoldenSource() {
  const Points reference = MadeReference();
  const Eigen::Quaterniond turn = RotationAboutAxis(Eigen::Vector3d::UnitZ(), 1.5) *
                                  RotationAboutAxis(Eigen::Vector3d::UnitX(), 1.5);
  Points source;
  for (size_t i = 0; i < reference.size(); i += 2) {
    source.push_back(turn * (0.98 * reference[i]) + Eigen::Vector3d(0.03, -0.02, 0.05));
  }
  return source;
}

TEST(AlignByIcp, EqualsScipy) {
  const nlohmann::json golden = ReadGolden("cloud_error");
  const Points points = GoldenSource();
  for (int i = 0; i < 3; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(points[size_t(i)][axis], golden["moved_points"][i][axis].get<double>(), 1e-14);
    }
  }
  const PointTree source(points);
  const PointTree target(MadeReference());
  for (const bool with_scale : {false, true}) {
    const nlohmann::json& expected = golden[with_scale ? "icp_with_scale" : "icp"];
    IcpOptions options;
    options.max_distance = 0.2;
    options.with_scale = with_scale;
    const auto result = AlignByIcp(source, target, {}, options);
    ASSERT_TRUE(result);
    const Eigen::Matrix3d rotation = result->target_from_source.rotation.toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        EXPECT_NEAR(rotation(row, column), expected["rotation"][row][column].get<double>(), 1e-9);
      }
      EXPECT_NEAR(result->target_from_source.translation[row],
                  expected["translation"][row].get<double>(),
                  1e-9);
    }
    EXPECT_NEAR(result->target_from_source.scale, expected["scale"].get<double>(), 1e-9);
    EXPECT_NEAR(result->share_paired, expected["share"].get<double>(), 1e-12);
    EXPECT_NEAR(result->rmse, expected["rmse"].get<double>(), 1e-9);
    EXPECT_EQ(result->num_iterations, expected["iterations"].get<int>());
  }
}

TEST(AlignByIcp, RecoversASmallMotion) {
  for (const double scale : {1.0, 0.99, 1.02}) {
    SCOPED_TRACE(scale);
    const Sim3d target_from_source = SmallMotion(scale);
    const Points points = MadePrediction();
    IcpOptions options;
    options.max_distance = 0.2;
    options.with_scale = scale != 1.0;
    options.max_iterations = 60;
    options.min_change = 0.0;
    const auto result =
        AlignByIcp(PointTree(points), PointTree(Moved(target_from_source, points)), {}, options);
    ASSERT_TRUE(result);
    // Once every point meets its own, the closed form is exact to rounding.
    EXPECT_NEAR(result->target_from_source.scale, scale, 1e-12);
    EXPECT_LT((result->target_from_source.translation - target_from_source.translation).norm(),
              1e-12);
    EXPECT_LT(AngleBetweenDeg(result->target_from_source.rotation, target_from_source.rotation),
              1e-6);
    EXPECT_LT(result->rmse, 1e-12);
    EXPECT_EQ(result->share_paired, 1.0);
  }
}

TEST(AlignByIcp, KeepsTheScaleOfTheFirstGuessUnlessItIsLookedFor) {
  const Sim3d target_from_source = SmallMotion(4.0);
  const Points points = MadePrediction();
  Sim3d guess;
  guess.scale = 4.0;
  IcpOptions options;
  options.max_distance = 1.0;
  options.max_iterations = 60;
  const auto result =
      AlignByIcp(PointTree(points), PointTree(Moved(target_from_source, points)), guess, options);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->target_from_source.scale, 4.0);
  EXPECT_LT(result->rmse, 1e-12);
}

TEST(AlignByIcp, ScaleDoesNotShrinkTheCloudIntoOtherOne) {
  // In one direction alone everything could end at a single point of the target.
  const Points points = MadePrediction();
  Sim3d guess;
  guess.scale = 0.7;
  IcpOptions options;
  options.max_distance = 10.0;
  options.with_scale = true;
  options.max_iterations = 100;
  const auto result = AlignByIcp(PointTree(points), PointTree(points), guess, options);
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->target_from_source.scale, 1.0, 1e-3);
}

TEST(AlignByIcp, WithoutPairsThereIsNoMotion) {
  const PointTree source(MadePrediction());
  Sim3d far_away;
  far_away.translation = {1000.0, 0.0, 0.0};
  EXPECT_FALSE(AlignByIcp(source, source, far_away));
  const PointTree line({{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {2.0, 0.0, 0.0}, {3.0, 0.0, 0.0}});
  EXPECT_FALSE(AlignByIcp(line, line, {}));
}

TEST(AlignByIcp, RefusesOptionsOutOfRange) {
  const PointTree source(MadePrediction());
  IcpOptions options;
  options.max_distance = 0.0;
  EXPECT_THROW(AlignByIcp(source, source, {}, options), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
