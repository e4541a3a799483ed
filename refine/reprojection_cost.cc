// SPDX-License-Identifier: BSD-3-Clause
#include "refine/reprojection_cost.h"

#include "refine/cross_matrix.h"
#include "refine/projection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <ceres/jet.h>
#include <ceres/sized_cost_function.h>

namespace vgtw {
namespace {

constexpr double kMinAbsDepth = 1e-10;  // in units of the extent of the cameras

// Derivative of  q X = X + 2 w u x X + 2 u x (u x X)  by q = (u, w).
Eigen::Matrix<double, 3, 4> RotatedByQuaternion(const Eigen::Quaterniond& q,
                                                const Eigen::Vector3d& point) {
  const Eigen::Vector3d u = q.vec();
  Eigen::Matrix3d by_u = u * point.transpose() - 2.0 * point * u.transpose();
  by_u -= q.w() * CrossMatrix(point);
  by_u.diagonal().array() += u.dot(point);
  Eigen::Matrix<double, 3, 4> by_q;
  by_q << 2.0 * by_u, 2.0 * u.cross(point);
  return by_q;
}

// Derivatives by the rigid motion and the focal lengths are written out; those of the distortion,
// by the two normalised coordinates and its own parameters, are left to dual numbers.
template <CameraModel kModel>
class ReprojectionCost final
    : public ceres::SizedCostFunction<2, kNumPoseParams, 3, NumCameraParams<kModel>()> {
 public:
  explicit ReprojectionCost(const Eigen::Vector2d& pixel) : pixel_(pixel) {}

  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> rotation(blocks[0]);
    const Eigen::Map<const Eigen::Vector3d> translation(blocks[0] + 4);
    const Eigen::Map<const Eigen::Vector3d> point(blocks[1]);
    const Eigen::Vector3d point_in_cam = rotation * point + translation;
    if (!(std::abs(point_in_cam.z()) > kMinAbsDepth)) return false;
    const double inverse_depth = 1.0 / point_in_cam.z();
    const Eigen::Vector2d ray = point_in_cam.head<2>() * inverse_depth;
    if (jacobians == nullptr) {
      ProjectNormalized<kModel>(blocks[2], ray.x(), ray.y(), residual);
      residual[0] -= pixel_.x();
      residual[1] -= pixel_.y();
      return true;
    }
    const Eigen::Matrix2d by_ray = Project(blocks[2], ray, residual, jacobians[2]);
    Eigen::Matrix<double, 2, 3> by_point_in_cam;
    by_point_in_cam << by_ray, -by_ray * ray;
    by_point_in_cam *= inverse_depth;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, kNumPoseParams, Eigen::RowMajor>> by_pose(jacobians[0]);
      by_pose << by_point_in_cam * RotatedByQuaternion(rotation, point), by_point_in_cam;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> by_point(jacobians[1]);
      by_point = by_point_in_cam * rotation.toRotationMatrix();
    }
    return true;
  }

 private:
  static constexpr int kNumParams = NumCameraParams<kModel>();
  static constexpr int kNumFocal = NumFocalLengths<kModel>();
  static constexpr int kNumExtra = kNumParams - kNumFocal - 2;

  // The residual, its derivative by (u, v), and into `by_params`, if there, that by the camera.
  Eigen::Matrix2d Project(const double* params,
                          const Eigen::Vector2d& ray,
                          double* residual,
                          double* by_params) const {
    using Dual = ceres::Jet<double, 2 + kNumExtra>;
    std::array<Dual, kNumExtra + 1> extra;  // no array is empty
    for (int i = 0; i < kNumExtra; ++i) extra[i] = Dual(params[kNumFocal + 2 + i], 2 + i);
    Dual distorted[2];
    Distort<kModel>(extra.data(), Dual(ray.x(), 0), Dual(ray.y(), 1), &distorted[0], &distorted[1]);
    Eigen::Matrix2d by_ray;
    if (by_params != nullptr) std::fill_n(by_params, 2 * kNumParams, 0.0);
    for (int row = 0; row < 2; ++row) {
      const int focal_idx = row * (kNumFocal - 1);
      const double focal_length = params[focal_idx];
      residual[row] = focal_length * distorted[row].a + params[kNumFocal + row] - pixel_[row];
      by_ray.row(row) = focal_length * distorted[row].v.template head<2>();
      if (by_params == nullptr) continue;
      double* derivatives = by_params + row * kNumParams;
      derivatives[focal_idx] = distorted[row].a;
      derivatives[kNumFocal + row] = 1.0;
      for (int i = 0; i < kNumExtra; ++i) {
        derivatives[kNumFocal + 2 + i] = focal_length * distorted[row].v[2 + i];
      }
    }
    return by_ray;
  }

  Eigen::Vector2d pixel_;
};

template <CameraModel kModel>
std::unique_ptr<ceres::CostFunction> Create(const Eigen::Vector2d& pixel) {
  return std::make_unique<ReprojectionCost<kModel>>(pixel);
}

template <int... kModels>
std::unique_ptr<ceres::CostFunction> Create(CameraModel model,
                                            const Eigen::Vector2d& pixel,
                                            std::integer_sequence<int, kModels...>) {
  using Function = std::unique_ptr<ceres::CostFunction> (*)(const Eigen::Vector2d&);
  static constexpr Function kFunctions[] = {&Create<static_cast<CameraModel>(kModels)>...};
  return kFunctions[static_cast<int>(model)](pixel);
}

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeReprojectionCost(CameraModel model,
                                                          const Eigen::Vector2d& pixel) {
  return Create(model, pixel, std::make_integer_sequence<int, kNumCameraModels>());
}

}  // namespace vgtw
