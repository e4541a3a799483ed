// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace vgtw {

// A rigid motion b_from_a:  x_in_b = rotation * x_in_a + translation.
// Camera axes: x right, y down, z forward (OpenCV, COLMAP). `rotation` is a unit quaternion.
struct Rigid3d {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_a) const {
    return rotation * point_in_a + translation;
  }
  Eigen::Matrix<double, 3, 4> ToMatrix() const;
};

// c_from_a = c_from_b * b_from_a.
Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a);

// a_from_b from b_from_a.
Rigid3d Inverse(const Rigid3d& b_from_a);

// The nearest rigid motion to [R|t]; nullopt if R is no rotation within 1 % (float16 keeps 0.1 %),
// or something is not finite.
std::optional<Rigid3d> RigidFromMatrix(const Eigen::Matrix<double, 3, 4>& matrix);

// Why the motion cannot be used (not finite, quaternion not of unit length to 1e-6), or "".
std::string FindFault(const Rigid3d& b_from_a);

// The origin of b seen in a; for cam_from_world this is the camera centre in the world.
Eigen::Vector3d OriginInSource(const Rigid3d& b_from_a);

// Angle of the rotation between two orientations, in degrees, in [0, 180].
double AngleBetweenDeg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

// Rotation by `angle_deg` around a unit axis.
Eigen::Quaterniond RotationAboutAxis(const Eigen::Vector3d& axis, double angle_deg);

// cam_from_world of a camera at `centre` that looks at `target` with `up_in_world` upwards in the
// image (towards -y). Throws std::invalid_argument if up is parallel to the view direction.
Rigid3d LookAt(const Eigen::Vector3d& centre,
               const Eigen::Vector3d& target,
               const Eigen::Vector3d& up_in_world);

}  // namespace vgtw
