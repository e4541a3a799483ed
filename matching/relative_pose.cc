// SPDX-License-Identifier: BSD-3-Clause
#include "matching/relative_pose.h"

#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace vgtw {
namespace {

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

constexpr int kMaxIterations = 20;
constexpr double kStep = 1e-6;             // of the numerical derivative, radians
constexpr double kMinRelativeGain = 1e-9;  // of the cost, per iteration

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

// Turned by delta(0..2) in the second camera; translation moved on the unit sphere by delta(3..4).
Rigid3d Move(const Rigid3d& cam2_from_cam1, const Vector5d& delta) {
  const Eigen::Vector3d turn = delta.head<3>();
  const double angle = turn.norm();
  const Eigen::Vector3d& t = cam2_from_cam1.translation;
  const Eigen::Vector3d side = t.unitOrthogonal();
  Rigid3d moved = cam2_from_cam1;
  if (angle > 0.0) {
    moved.rotation =
        (Eigen::AngleAxisd(angle, turn / angle) * cam2_from_cam1.rotation).normalized();
  }
  moved.translation = (t + delta(3) * side + delta(4) * t.cross(side)).normalized();
  return moved;
}

// Signed, so that it is smooth at 0.
double SignedSampson(const Eigen::Matrix3d& matrix,
                     const Eigen::Vector2d& x1,
                     const Eigen::Vector2d& x2) {
  const Eigen::Vector3d line2 = matrix * x1.homogeneous();
  const Eigen::Vector3d line1 = matrix.transpose() * x2.homogeneous();
  const double norm2 = line1.head<2>().squaredNorm() + line2.head<2>().squaredNorm();
  return norm2 > 0.0 ? x2.homogeneous().dot(line2) / std::sqrt(norm2) : 0.0;
}

double CauchyCost(const std::vector<RayPair>& pairs, double scale, const Rigid3d& cam2_from_cam1) {
  const Eigen::Matrix3d E = EssentialMatrix(cam2_from_cam1);
  double cost = 0.0;
  for (const RayPair& pair : pairs) {
    const double r = SignedSampson(E, pair.ray1, pair.ray2) / scale;
    cost += std::log1p(r * r);
  }
  return cost;
}

// Normal equations of the reweighted least squares at a pose.
void Linearise(const std::vector<RayPair>& pairs,
               double scale,
               const Rigid3d& cam2_from_cam1,
               Matrix5d& JtJ,
               Vector5d& Jtr) {
  const Eigen::Matrix3d E = EssentialMatrix(cam2_from_cam1);
  std::array<Eigen::Matrix3d, 5> forward, backward;
  for (size_t k = 0; k < 5; ++k) {
    const Vector5d step = kStep * Vector5d::Unit(static_cast<Eigen::Index>(k));
    forward[k] = EssentialMatrix(Move(cam2_from_cam1, step));
    backward[k] = EssentialMatrix(Move(cam2_from_cam1, -step));
  }
  JtJ.setZero();
  Jtr.setZero();
  for (const RayPair& pair : pairs) {
    const double r = SignedSampson(E, pair.ray1, pair.ray2) / scale;
    Vector5d J;
    for (size_t k = 0; k < 5; ++k) {
      J(static_cast<Eigen::Index>(k)) = (SignedSampson(forward[k], pair.ray1, pair.ray2) -
                                         SignedSampson(backward[k], pair.ray1, pair.ray2)) /
                                        (2.0 * kStep * scale);
    }
    const double weight = 1.0 / (1.0 + r * r);
    JtJ += weight * J * J.transpose();
    Jtr += weight * r * J;
  }
}

}  // namespace

Eigen::Matrix3d EssentialMatrix(const Rigid3d& cam2_from_cam1) {
  return Cross(cam2_from_cam1.translation) * cam2_from_cam1.rotation.toRotationMatrix();
}

double SampsonDistance(const Eigen::Matrix3d& matrix,
                       const Eigen::Vector2d& x1,
                       const Eigen::Vector2d& x2) {
  return std::abs(SignedSampson(matrix, x1, x2));
}

Rigid3d RefineRelativePose(const std::vector<RayPair>& pairs,
                           double scale,
                           const Rigid3d& cam2_from_cam1) {
  Rigid3d best = cam2_from_cam1;
  best.translation.normalize();
  double best_cost = CauchyCost(pairs, scale, best);
  double damping = 1e-3;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Matrix5d JtJ;
    Vector5d Jtr;
    Linearise(pairs, scale, best, JtJ, Jtr);
    Matrix5d damped = JtJ;
    damped.diagonal() *= 1.0 + damping;
    const Vector5d step = -damped.ldlt().solve(Jtr);
    if (!step.allFinite()) break;
    const Rigid3d moved = Move(best, step);
    const double cost = CauchyCost(pairs, scale, moved);
    if (cost < best_cost) {
      const double gain = best_cost - cost;
      best = moved;
      best_cost = cost;
      damping *= 0.1;
      if (gain < kMinRelativeGain * cost) break;
    } else {
      damping *= 10.0;
      if (damping > 1e6) break;
    }
  }
  return best;
}

std::optional<Eigen::Vector2d> TriangulateDepths(const RayPair& pair,
                                                 const Rigid3d& cam2_from_cam1) {
  // depth2 ray2 - depth1 R ray1 = t in the least squares sense.
  Eigen::Matrix<double, 3, 2> A;
  A.col(0) = -(cam2_from_cam1.rotation * pair.ray1.homogeneous());
  A.col(1) = pair.ray2.homogeneous();
  const Eigen::Matrix2d AtA = A.transpose() * A;
  if (AtA.determinant() <= 1e-12 * AtA(0, 0) * AtA(1, 1)) return std::nullopt;
  return Eigen::Vector2d(AtA.inverse() * A.transpose() * cam2_from_cam1.translation);
}

Rigid3d RelativePoseFromEssential(const Eigen::Matrix3d& E, const std::vector<RayPair>& pairs) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  Eigen::Matrix3d V = svd.matrixV();
  if (U.determinant() < 0.0) U = -U;
  if (V.determinant() < 0.0) V = -V;
  Eigen::Matrix3d W;
  W << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  Rigid3d best;
  int64_t best_num_in_front = -1;
  for (const Eigen::Matrix3d& R : {Eigen::Matrix3d(U * W * V.transpose()),
                                   Eigen::Matrix3d(U * W.transpose() * V.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      const Rigid3d candidate = {Eigen::Quaterniond(R).normalized(), sign * U.col(2)};
      int64_t num_in_front = 0;
      for (const RayPair& pair : pairs) {
        const auto depths = TriangulateDepths(pair, candidate);
        if (depths && depths->minCoeff() > 0.0) ++num_in_front;
      }
      if (num_in_front > best_num_in_front) {
        best = candidate;
        best_num_in_front = num_in_front;
      }
    }
  }
  return best;
}

Eigen::Quaterniond RotationBetween(const std::vector<RayPair>& pairs) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const RayPair& pair : pairs) {
    sum += pair.ray2.homogeneous().normalized() * pair.ray1.homogeneous().normalized().transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  return Eigen::Quaterniond(Eigen::Matrix3d(U * svd.matrixV().transpose())).normalized();
}

}  // namespace vgtw
