// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/relative_pose.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace vgtw {

// How far estimates lie from the truth, root mean square over noise.
struct PoseSigma {
  double rotation_deg = 0.0;
  double direction_deg = 0.0;  // of the translation
};

// The bound of Cramer and Rao for exact pairs of a pose with a translation of length 1, to which
// normal noise of `sigma` per coordinate of both rays is added: no unbiased estimate is better.
inline PoseSigma LeastPoseSigma(const std::vector<RayPair>& pairs,
                                const Rigid3d& cam2_from_cam1,
                                double sigma) {
  constexpr double kStep = 1e-6;
  const Eigen::Vector3d side = cam2_from_cam1.translation.unitOrthogonal();
  const auto moved = [&](int k, double step) {
    Rigid3d pose = cam2_from_cam1;
    if (k < 3) {
      pose.rotation = Eigen::AngleAxisd(step, Eigen::Vector3d::Unit(k)) * pose.rotation;
    } else {
      pose.translation += step * (k == 3 ? side : pose.translation.cross(side));
    }
    return EssentialMatrix(pose);
  };
  Eigen::Matrix<double, 5, 5> information = Eigen::Matrix<double, 5, 5>::Zero();
  for (const RayPair& pair : pairs) {
    const Eigen::Vector3d x1 = pair.ray1.homogeneous();
    const Eigen::Vector3d x2 = pair.ray2.homogeneous();
    const Eigen::Matrix3d E = EssentialMatrix(cam2_from_cam1);
    const double norm =
        std::hypot((E * x1).head<2>().norm(), (E.transpose() * x2).head<2>().norm());
    Eigen::Matrix<double, 5, 1> J;
    for (int k = 0; k < 5; ++k) {
      J(k) = x2.dot((moved(k, kStep) - moved(k, -kStep)) * x1) / (2.0 * kStep * norm);
    }
    information += J * J.transpose() / (sigma * sigma);
  }
  const Eigen::Matrix<double, 5, 1> variances = information.inverse().diagonal();
  const double deg = 180.0 / std::numbers::pi;
  return {deg * std::sqrt(variances.head<3>().sum()), deg * std::sqrt(variances.tail<2>().sum())};
}

}  // namespace vgtw
