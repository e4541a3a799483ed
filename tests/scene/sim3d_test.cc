// SPDX-License-Identifier: BSD-3-Clause
#include "scene/sim3d.h"

#include "scene/camera.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// Closed forms on numbers of size 10 are exact to some 1e-15.
constexpr double kRounding = 1e-12;

Sim3d RandomSim3d() {
  return {std::exp(Eigen::Vector2d::Random().x()),
          Eigen::Quaterniond(Eigen::Vector4d::Random().normalized()),
          5.0 * Eigen::Vector3d::Random()};
}

Points RandomPoints(size_t n) {
  Points points(n);
  for (Eigen::Vector3d& point : points) point = Eigen::Vector3d::Random();
  return points;
}

Points Transformed(const Sim3d& b_from_a, const Points& points_in_a) {
  Points points_in_b;
  for (const Eigen::Vector3d& point : points_in_a) points_in_b.push_back(b_from_a * point);
  return points_in_b;
}

void ExpectNear(const Sim3d& actual, const Sim3d& expected, double tolerance) {
  EXPECT_NEAR(actual.scale, expected.scale, tolerance);
  EXPECT_LT(AngleBetweenDeg(actual.rotation, expected.rotation), 60.0 * tolerance);
  EXPECT_LT((actual.translation - expected.translation).norm(), tolerance);
}

TEST(Sim3d, MovesAHandComputedPoint) {
  const Sim3d b_from_a = {2.0, RotationAboutAxis(Eigen::Vector3d::UnitZ(), 90.0), {10, 20, 30}};
  EXPECT_LT((b_from_a * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(6, 22, 36)).norm(), kRounding);
}

TEST(Sim3d, ProductAndInverseObeyTheirLaws) {
  for (int i = 0; i < 20; ++i) {
    const Sim3d c_from_b = RandomSim3d();
    const Sim3d b_from_a = RandomSim3d();
    const Eigen::Vector3d point = Eigen::Vector3d::Random();
    EXPECT_LT(((c_from_b * b_from_a) * point - c_from_b * (b_from_a * point)).norm(), kRounding);
    EXPECT_LT((Inverse(b_from_a) * (b_from_a * point) - point).norm(), kRounding);
  }
}

TEST(Sim3d, TransformedCameraSeesTheSamePixelsAtScaledDepths) {
  const Camera camera = MakePinhole(640, 480, 500, 510);
  for (int i = 0; i < 20; ++i) {
    const Sim3d b_from_a = RandomSim3d();
    const Eigen::Vector3d point_in_a = Eigen::Vector3d::Random();
    const Rigid3d cam_from_a =
        LookAt(point_in_a + Eigen::Vector3d(1, 2, 5), point_in_a * 0.5, Eigen::Vector3d::UnitY());
    const Rigid3d cam_from_b = TransformCamera(b_from_a, cam_from_a);
    const Eigen::Vector3d before = cam_from_a * point_in_a;
    const Eigen::Vector3d after = cam_from_b * (b_from_a * point_in_a);
    EXPECT_LT((after - b_from_a.scale * before).norm(), kRounding);
    // Pixels are rays times 500.
    EXPECT_LT((*Project(camera, after) - *Project(camera, before)).norm(), 1e-9);
  }
}

TEST(EstimateSim3d, RecoversExactSimilarities) {
  for (const size_t n : {3, 4, 50}) {
    const Sim3d truth = RandomSim3d();
    const Points points = RandomPoints(n);
    const auto b_from_a = EstimateSim3d(points, Transformed(truth, points));
    ASSERT_TRUE(b_from_a);
    ExpectNear(*b_from_a, truth, 1e-10);  // three random points may be nearly collinear
  }
}

TEST(EstimateSim3d, RecoversFromPlanarPoints) {
  const Sim3d truth = RandomSim3d();
  Points points = RandomPoints(20);
  for (Eigen::Vector3d& point : points) point.z() = 0.0;
  const auto b_from_a = EstimateSim3d(points, Transformed(truth, points));
  ASSERT_TRUE(b_from_a);
  ExpectNear(*b_from_a, truth, kRounding);
}

TEST(EstimateSim3d, NeverReturnsAReflection) {
  // Umeyama's own example of why the sign matters: b is a mirrored in x.
  const Points points_in_a = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  Points points_in_b = points_in_a;
  for (Eigen::Vector3d& point : points_in_b) point.x() = -point.x();
  const auto b_from_a = EstimateSim3d(points_in_a, points_in_b);
  ASSERT_TRUE(b_from_a);
  EXPECT_NEAR(b_from_a->rotation.toRotationMatrix().determinant(), 1.0, kRounding);
  EXPECT_GT(b_from_a->scale, 0.0);
  EXPECT_LT(b_from_a->scale, 1.0);
}

TEST(EstimateSim3d, MinimisesTheWeightedSumOfSquares) {
  const Points points_in_a = RandomPoints(12);
  Points points_in_b = Transformed(RandomSim3d(), points_in_a);
  std::vector<double> weights;
  for (Eigen::Vector3d& point : points_in_b) {
    point += 0.1 * Eigen::Vector3d::Random();
    weights.push_back(1.0 + Eigen::Vector2d::Random().x());
  }
  const auto cost = [&](const Sim3d& b_from_a) {
    double sum = 0.0;
    for (size_t i = 0; i < points_in_a.size(); ++i) {
      sum += weights[i] * (points_in_b[i] - b_from_a * points_in_a[i]).squaredNorm();
    }
    return sum;
  };
  const Sim3d best = EstimateSim3d(points_in_a, points_in_b, weights).value();
  // A minimum: the cost rises in both directions of each of the seven degrees of freedom.
  for (const double step : {-1e-4, 1e-4}) {
    Sim3d other = best;
    other.scale *= 1.0 + step;
    EXPECT_GT(cost(other), cost(best));
    for (int axis = 0; axis < 3; ++axis) {
      other = best;
      other.translation[axis] += step;
      EXPECT_GT(cost(other), cost(best));
      other = best;
      other.rotation = RotationAboutAxis(Eigen::Vector3d::Unit(axis), 60.0 * step) * best.rotation;
      EXPECT_GT(cost(other), cost(best));
    }
  }
}

TEST(EstimateSim3d, IntegerWeightsEqualRepeatedPoints) {
  const Points points_in_a = RandomPoints(5);
  const Points points_in_b = RandomPoints(5);
  Points repeated_a = points_in_a;
  Points repeated_b = points_in_b;
  repeated_a.insert(repeated_a.end(), 2, points_in_a[1]);
  repeated_b.insert(repeated_b.end(), 2, points_in_b[1]);
  repeated_a.erase(repeated_a.begin() + 4);
  repeated_b.erase(repeated_b.begin() + 4);
  const auto weighted = EstimateSim3d(points_in_a, points_in_b, {1, 3, 1, 1, 0});
  const auto repeated = EstimateSim3d(repeated_a, repeated_b);
  ASSERT_TRUE(weighted && repeated);
  ExpectNear(*weighted, *repeated, 1e-11);
}

TEST(EstimateSim3d, UndeterminedRotationsHaveNoResult) {
  const Eigen::Vector3d direction(1, 2, 3);
  const Points line = {direction * 0.1, direction * 0.7, direction * -2.0, direction * 1e3};
  const Points points = RandomPoints(4);
  EXPECT_FALSE(EstimateSim3d(line, Transformed(RandomSim3d(), line)));
  EXPECT_FALSE(EstimateSim3d(points, line));
  EXPECT_FALSE(EstimateSim3d({points[0], points[1]}, {points[2], points[3]}));
  EXPECT_FALSE(EstimateSim3d(Points(4, points[0]), points));
  EXPECT_FALSE(EstimateSim3d(points, Points(4, points[0])));
  EXPECT_FALSE(EstimateSim3d(points, points, {1, 1, 0, 0}));
  EXPECT_FALSE(EstimateSim3d({}, {}));
}

TEST(EstimateSim3d, RefusesBrokenInput) {
  const Points points = RandomPoints(3);
  Points broken = points;
  broken[1].z() = std::nan("");
  EXPECT_THROW(EstimateSim3d(points, RandomPoints(4)), std::invalid_argument);
  EXPECT_THROW(EstimateSim3d(points, broken), std::invalid_argument);
  EXPECT_THROW(EstimateSim3d(points, points, {1, 1}), std::invalid_argument);
  EXPECT_THROW(EstimateSim3d(points, points, {1, 1, -1}), std::invalid_argument);
  EXPECT_THROW(EstimateSim3dRobust(points, broken), std::invalid_argument);
  EXPECT_THROW(EstimateSim3dRobust(points, points, {.max_residual = -1}), std::invalid_argument);
  EXPECT_THROW(EstimateSim3dRobust(points, points, {.max_iterations = 0}), std::invalid_argument);
}

// The first `num_outliers` of `n` pairs are far off.
struct Pairs {
  Sim3d truth = RandomSim3d();
  Points points_in_a;
  Points points_in_b;
};

Pairs MakePairs(size_t n, size_t num_outliers, double noise) {
  Pairs pairs;
  pairs.points_in_a = RandomPoints(n);
  pairs.points_in_b = Transformed(pairs.truth, pairs.points_in_a);
  for (size_t i = 0; i < n; ++i) {
    pairs.points_in_b[i] += (i < num_outliers ? 10.0 : noise) * Eigen::Vector3d::Random();
  }
  return pairs;
}

TEST(EstimateSim3dRobust, FindsExactlyTheInliersAmongFortyPercentOutliers) {
  for (const double max_residual : {0.0, 0.05}) {
    const Pairs pairs = MakePairs(50, 20, 0.0);
    const auto robust =
        EstimateSim3dRobust(pairs.points_in_a, pairs.points_in_b, {.max_residual = max_residual});
    ASSERT_TRUE(robust);
    ExpectNear(robust->b_from_a, pairs.truth, kRounding);
    for (size_t i = 0; i < 50; ++i) EXPECT_EQ(robust->is_inlier[i], i >= 20) << i;
  }
}

TEST(EstimateSim3dRobust, EqualsTheEstimateFromTheTrueInliersUnderNoise) {
  const Pairs pairs = MakePairs(60, 24, 0.01);
  const auto robust = EstimateSim3dRobust(pairs.points_in_a, pairs.points_in_b);
  ASSERT_TRUE(robust);
  std::vector<double> weights(60, 1.0);
  std::fill_n(weights.begin(), 24, 0.0);
  const auto oracle = EstimateSim3d(pairs.points_in_a, pairs.points_in_b, weights);
  for (size_t i = 0; i < 60; ++i) EXPECT_EQ(robust->is_inlier[i], i >= 24) << i;
  ExpectNear(robust->b_from_a, *oracle, kRounding);
  // The noise has length 0.01 (uniform in a cube of half side 0.01); the threshold is a few of it.
  EXPECT_GT(robust->max_residual, 0.01);
  EXPECT_LT(robust->max_residual, 0.1);
}

TEST(EstimateSim3d, OfFixedScaleIsTheBestRigidMotion) {
  const Points points_in_a = RandomPoints(10);
  const Sim3d rigid = {1.0, RandomSim3d().rotation, {1.0, 2.0, 3.0}};
  ExpectNear(
      *EstimateSim3d(points_in_a, Transformed(rigid, points_in_a), {}, true), rigid, kRounding);
  // Of a scaled copy the rotation and the centroid are met.
  Sim3d scaled = rigid;
  scaled.scale = 3.0;
  const Points points_in_b = Transformed(scaled, points_in_a);
  const auto best = EstimateSim3d(points_in_a, points_in_b, {}, true);
  ASSERT_TRUE(best);
  EXPECT_EQ(best->scale, 1.0);
  EXPECT_LT(AngleBetweenDeg(best->rotation, rigid.rotation), 60.0 * kRounding);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < points_in_a.size(); ++i) sum += points_in_b[i] - *best * points_in_a[i];
  EXPECT_LT(sum.norm(), 10.0 * kRounding);
}

TEST(EstimateSim3dRobust, IsDeterministicBySeed) {
  const Pairs pairs = MakePairs(40, 10, 0.05);
  const RobustSim3dOptions options = {.max_iterations = 50, .seed = 7};
  const auto first = EstimateSim3dRobust(pairs.points_in_a, pairs.points_in_b, options);
  const auto second = EstimateSim3dRobust(pairs.points_in_a, pairs.points_in_b, options);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->is_inlier, second->is_inlier);
  EXPECT_EQ(first->b_from_a.translation, second->b_from_a.translation);
}

TEST(EstimateSim3dRobust, HandlesThreeAndFourPairs) {
  const Pairs three = MakePairs(3, 0, 0.0);
  const auto exact = EstimateSim3dRobust(three.points_in_a, three.points_in_b);
  ASSERT_TRUE(exact);
  ExpectNear(exact->b_from_a, three.truth, 1e-10);
  Pairs four = MakePairs(4, 1, 0.0);
  const auto robust = EstimateSim3dRobust(four.points_in_a, four.points_in_b);
  ASSERT_TRUE(robust);
  ExpectNear(robust->b_from_a, four.truth, 1e-10);
  EXPECT_EQ(robust->is_inlier, (std::vector<bool>{false, true, true, true}));
}

TEST(EstimateSim3dRobust, UndeterminedRotationsHaveNoResult) {
  const Points points = RandomPoints(10);
  Points line;
  for (const Eigen::Vector3d& point : points) line.push_back(point.x() * Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(EstimateSim3dRobust(line, line));
  EXPECT_FALSE(EstimateSim3dRobust({points[0], points[1]}, {points[0], points[1]}));
  EXPECT_FALSE(EstimateSim3dRobust(Points(10, points[0]), points));
}

}  // namespace
}  // namespace vgtw
