// SPDX-License-Identifier: BSD-3-Clause
#include "matching/relative_pose.h"

#include "scene/random.h"
#include "tests/matching/relative_pose_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Rays are floats of a camera of this focal length where noise is in pixels.
constexpr double kFocalLength = 600.0;

Rigid3d SamplePose() {
  return {RotationAboutAxis(Eigen::Vector3d(0.2, 1.0, -0.3).normalized(), 12.0),
          Eigen::Vector3d(-0.9, 0.1, 0.3).normalized()};
}

// Points 4 to 9 in front of camera 1 and their exact rays.
std::vector<RayPair> SamplePairs(const Rigid3d& cam2_from_cam1, size_t count, uint64_t seed) {
  RandomStream random(seed);
  std::vector<RayPair> pairs;
  while (pairs.size() < count) {
    const double x = random.Uniform(-0.5, 0.5);
    const double y = random.Uniform(-0.4, 0.4);
    const double depth = random.Uniform(4.0, 9.0);
    const Eigen::Vector3d point1(depth * x, depth * y, depth);
    const Eigen::Vector3d point2 = cam2_from_cam1 * point1;
    pairs.push_back({point1.hnormalized(), point2.hnormalized()});
  }
  return pairs;
}

double DirectionDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

double CauchyCost(const std::vector<RayPair>& pairs, double scale, const Rigid3d& pose) {
  double cost = 0.0;
  for (const RayPair& pair : pairs) {
    const double r = SampsonDistance(EssentialMatrix(pose), pair.ray1, pair.ray2) / scale;
    cost += std::log1p(r * r);
  }
  return cost;
}

TEST(EssentialMatrix, ByHand) {
  // A step to the right: rows of the images correspond.
  Eigen::Matrix3d expected;
  expected << 0, 0, 0, 0, 0, 1, 0, -1, 0;
  EXPECT_EQ(EssentialMatrix({Eigen::Quaterniond::Identity(), {-1, 0, 0}}), expected);
  // Turned by a quarter about z: [t]x R with R = (0 -1 0; 1 0 0; 0 0 1) and t = (1, 2, 3).
  expected << -3, 0, 2, 0, -3, -1, 1, 2, 0;
  const Rigid3d turned = {RotationAboutAxis(Eigen::Vector3d::UnitZ(), 90.0), {1, 2, 3}};
  EXPECT_LT((EssentialMatrix(turned) - expected).norm(), 1e-14);
}

TEST(EssentialMatrix, HoldsForTheImagesOfAPoint) {
  for (const RayPair& pair : SamplePairs(SamplePose(), 200, 1)) {
    const double residual =
        pair.ray2.homogeneous().dot(EssentialMatrix(SamplePose()) * pair.ray1.homogeneous());
    EXPECT_NEAR(residual, 0.0, 1e-15);
    EXPECT_NEAR(SampsonDistance(EssentialMatrix(SamplePose()), pair.ray1, pair.ray2), 0.0, 1e-15);
  }
}

TEST(SampsonDistance, ByHand) {
  // Rows correspond: off by d in one image is off by d / sqrt(2) in each.
  const Eigen::Matrix3d E = EssentialMatrix({Eigen::Quaterniond::Identity(), {1, 0, 0}});
  EXPECT_NEAR(SampsonDistance(E, {0.3, 0.1}, {-0.7, 0.1}), 0.0, 1e-16);
  EXPECT_NEAR(SampsonDistance(E, {0.3, 0.1}, {-0.7, 0.4}), 0.3 / std::sqrt(2.0), 1e-15);
  EXPECT_NEAR(SampsonDistance(E, {0.3, 0.4}, {-0.7, 0.1}), 0.3 / std::sqrt(2.0), 1e-15);
  // F = (1 0 0; 0 0 0; 0 0 2): x2 x1 + 2 = 8 over |(x2, x1)| = |(3, 2)|.
  const Eigen::Matrix3d F = Eigen::Vector3d(1.0, 0.0, 2.0).asDiagonal();
  EXPECT_NEAR(SampsonDistance(F, {2.0, 7.0}, {3.0, -5.0}), 8.0 / std::sqrt(13.0), 1e-14);
}

TEST(SampsonDistance, DoesNotDependOnTheScaleOfTheMatrix) {
  const Eigen::Matrix3d E = EssentialMatrix(SamplePose());
  for (const double factor : {-1.0, 1e-6, 1e6}) {
    EXPECT_NEAR(SampsonDistance(factor * E, {0.3, 0.1}, {0.2, 0.4}),
                SampsonDistance(E, {0.3, 0.1}, {0.2, 0.4}),
                1e-12);
  }
  EXPECT_EQ(SampsonDistance(Eigen::Matrix3d::Zero(), {0.3, 0.1}, {0.2, 0.4}), 0.0);
}

// To first order the distance to the nearest pair that fulfils the equation: a pair moved by noise
// is at most as far as it was moved, and the mean square is one of the four dimensions of noise.
TEST(SampsonDistance, IsTheDistanceToTheNearestTruePair) {
  const Eigen::Matrix3d E = EssentialMatrix(SamplePose());
  RandomStream random(2);
  const double sigma = 1e-4;
  double sum = 0.0;
  const auto pairs = SamplePairs(SamplePose(), 4000, 3);
  for (const RayPair& pair : pairs) {
    const Eigen::Vector2d offset1 = sigma * random.NormalVector().head<2>();
    const Eigen::Vector2d offset2 = sigma * random.NormalVector().head<2>();
    const double distance = SampsonDistance(E, pair.ray1 + offset1, pair.ray2 + offset2);
    const double moved = std::hypot(offset1.norm(), offset2.norm());
    EXPECT_LT(distance, moved * 1.01);  // the second order is sigma against rays of about 0.5
    sum += distance * distance;
  }
  // A mean of 4000 squares of normal numbers deviates by sqrt(2 / 4000) = 2.2 %; four times that.
  EXPECT_NEAR(sum / 4000.0 / (sigma * sigma), 1.0, 0.09);
}

TEST(TriangulateDepths, ByHandAndExact) {
  // Cameras side by side, a point 5 in front of the first and in the middle.
  const Rigid3d side = {Eigen::Quaterniond::Identity(), {-2.0, 0.0, 0.0}};
  const auto depths = TriangulateDepths({{0.2, 0.1}, {-0.2, 0.1}}, side);
  ASSERT_TRUE(depths);
  EXPECT_LT((*depths - Eigen::Vector2d(5.0, 5.0)).norm(), 1e-13);
  // Looking apart, they meet behind.
  const auto behind = TriangulateDepths({{-0.2, 0.1}, {0.2, 0.1}}, side);
  ASSERT_TRUE(behind);
  EXPECT_LT((*behind + Eigen::Vector2d(5.0, 5.0)).norm(), 1e-13);
}

TEST(TriangulateDepths, AreDepthsAlongZOfTurnedCameras) {
  RandomStream random(4);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Quaterniond rotation =
        RotationAboutAxis(random.NormalVector().normalized(), random.Uniform(0.0, 40.0));
    const Rigid3d pose = {rotation, random.NormalVector()};
    const Eigen::Vector3d point1(random.Uniform(), random.Uniform(), 6.0);
    const Eigen::Vector3d point2 = pose * point1;
    const auto depths = TriangulateDepths({point1.hnormalized(), point2.hnormalized()}, pose);
    ASSERT_TRUE(depths);
    EXPECT_NEAR((*depths)(0), 6.0, 1e-8);
    EXPECT_NEAR((*depths)(1), point2.z(), 1e-8);
  }
}

TEST(TriangulateDepths, ParallelRaysMeetNowhere) {
  const Rigid3d pose = SamplePose();
  const Eigen::Vector3d ray1(0.1, -0.2, 1.0);
  const Eigen::Vector2d parallel = (pose.rotation * ray1).hnormalized();
  EXPECT_FALSE(TriangulateDepths({ray1.head<2>(), parallel}, pose));
  // A hundred times the angle that counts as parallel.
  EXPECT_TRUE(TriangulateDepths({ray1.head<2>(), parallel + Eigen::Vector2d(1e-4, 0.0)}, pose));
  // Also where there is no baseline: then all meet at 0.
  EXPECT_FALSE(TriangulateDepths({{0.1, 0.2}, {0.1, 0.2}}, {}));
}

TEST(RelativePoseFromEssential, IsExactForAnyPoseAndSign) {
  RandomStream random(5);
  for (int i = 0; i < 100; ++i) {
    const Rigid3d truth = {
        RotationAboutAxis(random.NormalVector().normalized(), random.Uniform(0.0, 30.0)),
        random.NormalVector().normalized()};
    const auto pairs = SamplePairs(truth, 20, HashKey({6, static_cast<uint64_t>(i)}));
    const double factor = (i % 2 == 0 ? -1.0 : 1.0) * random.Uniform(0.1, 10.0);
    const Rigid3d pose = RelativePoseFromEssential(factor * EssentialMatrix(truth), pairs);
    EXPECT_LT(AngleBetweenDeg(pose.rotation, truth.rotation), 1e-6);
    EXPECT_LT(DirectionDeg(pose.translation, truth.translation), 1e-6);
    EXPECT_NEAR(pose.translation.norm(), 1.0, 1e-12);
  }
}

// One matrix, four poses: which one it is only the points say. The twisted pose is turned by 180
// degrees about the baseline.
TEST(RelativePoseFromEssential, EachOfTheFourIsFoundByItsOwnPoints) {
  const Rigid3d truth = SamplePose();
  const Eigen::Quaterniond twist = RotationAboutAxis(truth.translation, 180.0);
  for (const double sign : {1.0, -1.0}) {
    for (const bool is_twisted : {false, true}) {
      const Rigid3d pose = {is_twisted ? twist * truth.rotation : truth.rotation,
                            sign * truth.translation};
      // The same matrix, up to its sign.
      const double agreement =
          EssentialMatrix(pose).cwiseProduct(EssentialMatrix(truth)).sum() / 2.0;
      EXPECT_NEAR(std::abs(agreement), 1.0, 1e-12);
      // Points in front of both: of random places those that are.
      RandomStream random(7);
      std::vector<RayPair> pairs;
      for (int i = 0; i < 100000 && pairs.size() < 30; ++i) {
        const Eigen::Vector3d point1 = 3.0 * random.NormalVector();
        const Eigen::Vector3d point2 = pose * point1;
        if (point1.z() < 0.1 || point2.z() < 0.1) continue;
        pairs.push_back({point1.hnormalized(), point2.hnormalized()});
      }
      ASSERT_EQ(pairs.size(), 30u);
      const Rigid3d found = RelativePoseFromEssential(EssentialMatrix(truth), pairs);
      EXPECT_LT(AngleBetweenDeg(found.rotation, pose.rotation), 1e-6);
      EXPECT_LT(DirectionDeg(found.translation, pose.translation), 1e-6);
    }
  }
}

TEST(RelativePoseFromEssential, MostPointsDecideNotAll) {
  const Rigid3d truth = SamplePose();
  auto pairs = SamplePairs(truth, 60, 8);
  // Nonsense that is in front of whatever it likes.
  RandomStream random(9);
  for (size_t i = 0; i < 25; ++i) {
    pairs[i].ray2 = {random.Uniform(-0.5, 0.5), random.Uniform(-0.5, 0.5)};
  }
  const Rigid3d pose = RelativePoseFromEssential(EssentialMatrix(truth), pairs);
  EXPECT_LT(AngleBetweenDeg(pose.rotation, truth.rotation), 1e-6);
  EXPECT_LT(DirectionDeg(pose.translation, truth.translation), 1e-6);
}

TEST(RefineRelativePose, StaysAtTheTruth) {
  const auto pairs = SamplePairs(SamplePose(), 50, 10);
  const Rigid3d pose = RefineRelativePose(pairs, 1.0 / kFocalLength, SamplePose());
  // Residuals are 1e-16 and their derivatives about 0.1: nothing to gain.
  EXPECT_LT(AngleBetweenDeg(pose.rotation, SamplePose().rotation), 1e-6);
  EXPECT_LT(DirectionDeg(pose.translation, SamplePose().translation), 1e-6);
}

TEST(RefineRelativePose, RecoversTheTruthFromAfar) {
  for (const double angle_deg : {0.5, 2.0, 5.0}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      RandomStream random(HashKey({11, seed}));
      const auto pairs = SamplePairs(SamplePose(), 100, HashKey({12, seed}));
      Rigid3d start = SamplePose();
      start.rotation =
          RotationAboutAxis(random.NormalVector().normalized(), angle_deg) * start.rotation;
      // The length of the translation of the start does not matter.
      start.translation = 7.0 * (RotationAboutAxis(random.NormalVector().normalized(), angle_deg) *
                                 start.translation);
      // As wide as the start is wrong, so that nothing counts as an outlier.
      const Rigid3d pose = RefineRelativePose(pairs, 0.05, start);
      EXPECT_LT(AngleBetweenDeg(pose.rotation, SamplePose().rotation), 1e-3) << angle_deg;
      EXPECT_LT(DirectionDeg(pose.translation, SamplePose().translation), 1e-3) << angle_deg;
      EXPECT_NEAR(pose.translation.norm(), 1.0, 1e-12);
    }
  }
}

// 200 pairs with noise of half a pixel, a quarter of them wrong. Cauchy's loss at two sigmas uses
// nine tenths of what there is to know; outliers within a few pixels by chance cost as much again.
TEST(RefineRelativePose, IsAsGoodAsNoiseAllowsDespiteOutliers) {
  const double sigma = 0.5 / kFocalLength;
  constexpr int kNumTrials = 40;
  double rotation2 = 0.0;
  double direction2 = 0.0;
  for (uint64_t seed = 0; seed < kNumTrials; ++seed) {
    RandomStream random(HashKey({13, seed}));
    auto pairs = SamplePairs(SamplePose(), 200, HashKey({14, seed}));
    const PoseSigma least =
        LeastPoseSigma({pairs.begin(), pairs.begin() + 150}, SamplePose(), sigma);
    for (size_t i = 0; i < pairs.size(); ++i) {
      pairs[i].ray1 += sigma * random.NormalVector().head<2>();
      pairs[i].ray2 += sigma * random.NormalVector().head<2>();
      if (i >= 150) pairs[i].ray2 = {random.Uniform(-0.5, 0.5), random.Uniform(-0.5, 0.5)};
    }
    Rigid3d start = SamplePose();
    start.rotation = RotationAboutAxis(random.NormalVector().normalized(), 0.5) * start.rotation;
    const Rigid3d pose = RefineRelativePose(pairs, 2.0 * sigma, start);
    EXPECT_LE(CauchyCost(pairs, 2.0 * sigma, pose), CauchyCost(pairs, 2.0 * sigma, SamplePose()));
    rotation2 +=
        std::pow(AngleBetweenDeg(pose.rotation, SamplePose().rotation) / least.rotation_deg, 2);
    direction2 +=
        std::pow(DirectionDeg(pose.translation, SamplePose().translation) / least.direction_deg, 2);
  }
  // 1.1 for the loss, 1.1 for the outliers; the mean square of 40 trials with about one weak
  // direction deviates by sqrt(2 / 40) = 22 %, so twice that is a factor of 1.2 more.
  EXPECT_LT(std::sqrt(rotation2 / kNumTrials), 1.1 * 1.1 * 1.2);
  EXPECT_LT(std::sqrt(direction2 / kNumTrials), 1.1 * 1.1 * 1.2);
}

// At the minimum no step of 1e-4 in any of the five directions lowers the cost.
TEST(RefineRelativePose, EndsWhereTheCostIsLeast) {
  RandomStream random(15);
  auto pairs = SamplePairs(SamplePose(), 80, 16);
  for (RayPair& pair : pairs) pair.ray2 += 1e-3 * random.NormalVector().head<2>();
  const double scale = 1e-3;
  const Rigid3d pose = RefineRelativePose(pairs, scale, SamplePose());
  const double cost = CauchyCost(pairs, scale, pose);
  for (int i = 0; i < 200; ++i) {
    Rigid3d other = pose;
    other.rotation = RotationAboutAxis(random.NormalVector().normalized(), 1e-2) * other.rotation;
    other.translation = (other.translation + 1e-3 * random.NormalVector()).normalized();
    EXPECT_GT(CauchyCost(pairs, scale, other), cost);
  }
}

TEST(RefineRelativePose, NothingToRefineWithDoesNoHarm) {
  const Rigid3d start = SamplePose();
  const Rigid3d same = RefineRelativePose({}, 1e-3, start);
  EXPECT_LT(AngleBetweenDeg(same.rotation, start.rotation), 1e-9);
  EXPECT_LT(DirectionDeg(same.translation, start.translation), 1e-9);
  // No direction: nothing that could be turned.
  const Rigid3d none = RefineRelativePose(SamplePairs(start, 10, 17), 1e-3, {});
  EXPECT_TRUE(none.rotation.coeffs().allFinite());
  EXPECT_TRUE(none.translation.allFinite());
  auto pairs = SamplePairs(start, 10, 18);
  pairs[3].ray1.x() = std::numeric_limits<double>::quiet_NaN();
  const Rigid3d nan = RefineRelativePose(pairs, 1e-3, start);
  EXPECT_LT(AngleBetweenDeg(nan.rotation, start.rotation), 1e-9);
  // Two pairs leave three dimensions open; both are fulfilled nonetheless.
  const auto two = SamplePairs(start, 2, 19);
  Rigid3d off = start;
  off.rotation = RotationAboutAxis(Eigen::Vector3d::UnitX(), 1.0) * off.rotation;
  EXPECT_LT(CauchyCost(two, 1e-2, RefineRelativePose(two, 1e-2, off)), 1e-6);
}

TEST(RotationBetween, IsExactForAnyRotation) {
  RandomStream random(20);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Quaterniond truth =
        RotationAboutAxis(random.NormalVector().normalized(), random.Uniform(0.0, 40.0));
    // Two rays are enough; more than two in a plane too.
    for (const size_t count : {2u, 3u, 50u}) {
      const auto pairs = SamplePairs({truth, Eigen::Vector3d::Zero()}, count, 21);
      EXPECT_LT(AngleBetweenDeg(RotationBetween(pairs), truth), 1e-5);
    }
  }
}

// Never a reflection, even where one would fit better.
TEST(RotationBetween, IsAlwaysARotation) {
  std::vector<RayPair> mirrored;
  for (const RayPair& pair : SamplePairs(SamplePose(), 30, 22)) {
    mirrored.push_back({pair.ray1, {-pair.ray1.x(), pair.ray1.y()}});
  }
  for (const auto& pairs : {mirrored, std::vector<RayPair>{}, std::vector<RayPair>(3)}) {
    const Eigen::Quaterniond rotation = RotationBetween(pairs);
    EXPECT_NEAR(rotation.norm(), 1.0, 1e-12);
    EXPECT_NEAR(rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
  }
}

// Not what SVD happens to give: no rotation near it agrees better.
TEST(RotationBetween, IsTheBestWithNoise) {
  RandomStream random(23);
  auto pairs = SamplePairs({SamplePose().rotation, Eigen::Vector3d::Zero()}, 40, 24);
  for (RayPair& pair : pairs) pair.ray2 += 1e-2 * random.NormalVector().head<2>();
  const auto agreement = [&](const Eigen::Quaterniond& rotation) {
    double sum = 0.0;
    for (const RayPair& pair : pairs) {
      sum +=
          pair.ray2.homogeneous().normalized().dot(rotation * pair.ray1.homogeneous().normalized());
    }
    return sum;
  };
  const Eigen::Quaterniond best = RotationBetween(pairs);
  for (int i = 0; i < 100; ++i) {
    EXPECT_LT(agreement(RotationAboutAxis(random.NormalVector().normalized(), 0.01) * best),
              agreement(best));
  }
}

}  // namespace
}  // namespace vgtw
