// SPDX-License-Identifier: BSD-3-Clause
#include "scene/rigid3d.h"

#include "scene/error.h"

#include <cmath>
#include <numbers>

#include <Eigen/LU>
#include <Eigen/SVD>

namespace vgtw {

Eigen::Matrix<double, 3, 4> Rigid3d::ToMatrix() const {
  Eigen::Matrix<double, 3, 4> matrix;
  matrix.leftCols<3>() = rotation.toRotationMatrix();
  matrix.col(3) = translation;
  return matrix;
}

Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(),
          c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

Rigid3d Inverse(const Rigid3d& b_from_a) {
  const Eigen::Quaterniond inverse = b_from_a.rotation.conjugate();
  return {inverse, -(inverse * b_from_a.translation)};
}

std::optional<Rigid3d> RigidFromMatrix(const Eigen::Matrix<double, 3, 4>& matrix) {
  if (!matrix.allFinite()) return std::nullopt;
  constexpr double kTolerance = 1e-2;
  const Eigen::Matrix3d read = matrix.leftCols<3>();
  const bool is_rotation =
      (read * read.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kTolerance &&
      read.determinant() > 0.0;
  if (!is_rotation) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(read, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  return Rigid3d{Eigen::Quaterniond(rotation).normalized(), matrix.col(3)};
}

std::string FindFault(const Rigid3d& b_from_a) {
  // Quaternions from float32 files are off by up to 1e-7.
  constexpr double kMaxNormError = 1e-6;
  if (!b_from_a.translation.allFinite()) return "the translation is not finite";
  if (!(std::abs(b_from_a.rotation.norm() - 1.0) <= kMaxNormError)) {
    return "the rotation is not a unit quaternion";
  }
  return {};
}

Eigen::Vector3d OriginInSource(const Rigid3d& b_from_a) {
  return -(b_from_a.rotation.conjugate() * b_from_a.translation);
}

double AngleBetweenDeg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  // atan2 keeps full precision near zero, where acos of the dot product loses half the digits.
  const Eigen::Quaterniond difference = a.conjugate() * b;
  const double angle_rad = 2.0 * std::atan2(difference.vec().norm(), std::abs(difference.w()));
  return angle_rad * 180.0 / std::numbers::pi;
}

Eigen::Quaterniond RotationAboutAxis(const Eigen::Vector3d& axis, double angle_deg) {
  const double angle_rad = angle_deg * std::numbers::pi / 180.0;
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis));
}

Rigid3d LookAt(const Eigen::Vector3d& centre,
               const Eigen::Vector3d& target,
               const Eigen::Vector3d& up_in_world) {
  const Eigen::Vector3d forward = (target - centre).normalized();
  const Eigen::Vector3d right = forward.cross(up_in_world.normalized());
  VGTW_CHECK(right.norm() > 1e-9, "the camera looks along its up direction");
  Eigen::Matrix3d rotation;
  rotation.row(0) = right.normalized();
  rotation.row(2) = forward;
  rotation.row(1) = rotation.row(2).cross(rotation.row(0));
  return {Eigen::Quaterniond(rotation), -(rotation * centre)};
}

}  // namespace vgtw
