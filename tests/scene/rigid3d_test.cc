// SPDX-License-Identifier: BSD-3-Clause
#include "scene/rigid3d.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Products of a few unit quaternions and numbers of size 10 are exact to some 1e-15.
constexpr double kRounding = 1e-13;

Rigid3d RandomRigid() {
  return {Eigen::Quaterniond(Eigen::Vector4d::Random().normalized()),
          10.0 * Eigen::Vector3d::Random()};
}

TEST(Rigid3d, MovesAHandComputedPoint) {
  // A quarter turn about z takes x to y.
  const Rigid3d b_from_a = {RotationAboutAxis(Eigen::Vector3d::UnitZ(), 90.0), {10, 20, 30}};
  EXPECT_LT((b_from_a * Eigen::Vector3d(1, 2, 3) - Eigen::Vector3d(8, 21, 33)).norm(), kRounding);
  EXPECT_LT((b_from_a.ToMatrix() * Eigen::Vector4d(1, 2, 3, 1) - Eigen::Vector3d(8, 21, 33)).norm(),
            kRounding);
}

TEST(Rigid3d, ProductAppliesTheRightFactorFirst) {
  for (int i = 0; i < 20; ++i) {
    const Rigid3d c_from_b = RandomRigid();
    const Rigid3d b_from_a = RandomRigid();
    const Eigen::Vector3d point = Eigen::Vector3d::Random();
    EXPECT_LT(((c_from_b * b_from_a) * point - c_from_b * (b_from_a * point)).norm(), kRounding);
    EXPECT_NEAR((c_from_b * b_from_a).rotation.norm(), 1.0, 1e-15);
  }
}

TEST(Rigid3d, InverseUndoes) {
  for (int i = 0; i < 20; ++i) {
    const Rigid3d b_from_a = RandomRigid();
    const Eigen::Vector3d point = Eigen::Vector3d::Random();
    EXPECT_LT((Inverse(b_from_a) * (b_from_a * point) - point).norm(), kRounding);
    EXPECT_LT((b_from_a * OriginInSource(b_from_a)).norm(), kRounding);
  }
}

TEST(Rigid3d, LookAtPutsTheTargetOnTheAxisAndUpUpwards) {
  const Eigen::Vector3d centre(1, 2, 3);
  const Eigen::Vector3d target(4, -2, 3);
  const Eigen::Vector3d up(0, 0, 7);
  const Rigid3d cam_from_world = LookAt(centre, target, up);
  EXPECT_LT((cam_from_world * target - Eigen::Vector3d(0, 0, 5)).norm(), kRounding);
  EXPECT_LT((OriginInSource(cam_from_world) - centre).norm(), kRounding);
  // `up` is square to the view direction here, so it is exactly -y in the image.
  EXPECT_LT((cam_from_world.rotation * up - Eigen::Vector3d(0, -7, 0)).norm(), kRounding);
  EXPECT_GT(cam_from_world.rotation.toRotationMatrix().determinant(), 0.0);
}

TEST(Rigid3d, LookAtDoesNotDependOnTheLengthOfUp) {
  const Rigid3d cam_from_world =
      LookAt(Eigen::Vector3d::Zero(), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -1e-12, 0));
  EXPECT_LT(AngleBetweenDeg(cam_from_world.rotation, Eigen::Quaterniond::Identity()), 1e-12);
}

TEST(Rigid3d, LookAtRefusesUndeterminedDirections) {
  const Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  EXPECT_THROW(LookAt(centre, {0, 0, 2}, {0, 0, 1}), std::invalid_argument);
  EXPECT_THROW(LookAt(centre, centre, {0, 0, 1}), std::invalid_argument);
  EXPECT_THROW(LookAt(centre, {0, 0, std::nan("")}, {0, 1, 0}), std::invalid_argument);
}

TEST(AngleBetweenDeg, IsExactFromTinyToStraightAngles) {
  const Eigen::Quaterniond base(Eigen::Vector4d(0.1, 0.2, 0.3, 0.9).normalized());
  for (const double angle_deg : {0.0, 1e-10, 1e-3, 30.0, 179.0, 180.0}) {
    const Eigen::Quaterniond turned =
        base * RotationAboutAxis(Eigen::Vector3d(3, 4, 0) / 5.0, angle_deg);
    // Rounding of the quaternions' 1e-16 is some 1e-14 degrees.
    EXPECT_NEAR(AngleBetweenDeg(base, turned), angle_deg, 1e-13);
    const Eigen::Quaterniond same_rotation(-turned.coeffs());
    EXPECT_NEAR(AngleBetweenDeg(base, same_rotation), angle_deg, 1e-13);
  }
}

TEST(Rigid3d, FaultsAreNamed) {
  EXPECT_EQ(FindFault(Rigid3d{}), "");
  EXPECT_EQ(FindFault(RandomRigid()), "");
  Rigid3d bad;
  bad.rotation.coeffs() *= 1.0 + 2e-6;
  EXPECT_EQ(FindFault(bad), "the rotation is not a unit quaternion");
  bad.rotation.coeffs().setZero();
  EXPECT_EQ(FindFault(bad), "the rotation is not a unit quaternion");
  bad.rotation.coeffs().setConstant(std::nan(""));
  EXPECT_EQ(FindFault(bad), "the rotation is not a unit quaternion");
  bad.translation.y() = std::numeric_limits<double>::infinity();
  EXPECT_EQ(FindFault(bad), "the translation is not finite");
}

TEST(RigidFromMatrix, RoundsToTheNearestRotation) {
  const Rigid3d truth = RandomRigid();
  Eigen::Matrix<double, 3, 4> matrix = truth.ToMatrix();
  EXPECT_LT((RigidFromMatrix(matrix)->ToMatrix() - matrix).cwiseAbs().maxCoeff(), kRounding);
  matrix(0, 0) += 1e-3;
  EXPECT_LT(AngleBetweenDeg(RigidFromMatrix(matrix)->rotation, truth.rotation), 0.1);
}

TEST(RigidFromMatrix, OtherMatricesGiveNone) {
  const Eigen::Matrix<double, 3, 4> truth = RandomRigid().ToMatrix();
  Eigen::Matrix<double, 3, 4> scaled = truth;
  scaled.leftCols<3>() *= 1.1;
  EXPECT_FALSE(RigidFromMatrix(scaled));
  Eigen::Matrix<double, 3, 4> mirrored = truth;
  mirrored.row(1) *= -1.0;
  EXPECT_FALSE(RigidFromMatrix(mirrored));
  Eigen::Matrix<double, 3, 4> unknown = truth;
  unknown(2, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(RigidFromMatrix(unknown));
  EXPECT_FALSE(RigidFromMatrix(Eigen::Matrix<double, 3, 4>::Zero()));
}

}  // namespace
}  // namespace vgtw
