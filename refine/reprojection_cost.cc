// SPDX-License-Identifier: BSD-3-Clause
#include "refine/reprojection_cost.h"

#include "refine/projection.h"

#include <cmath>
#include <utility>

#include <Eigen/Geometry>
#include <ceres/autodiff_cost_function.h>

namespace vgtw {
namespace {

constexpr double kMinAbsDepth = 1e-10;  // in units of the extent of the cameras

template <CameraModel kModel>
class ReprojectionCost {
 public:
  explicit ReprojectionCost(const Eigen::Vector2d& pixel) : pixel_(pixel) {}

  template <typename T>
  bool operator()(const T* cam_from_world,
                  const T* point_in_world,
                  const T* camera_params,
                  T* residual) const {
    using std::abs;
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(cam_from_world);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> translation(cam_from_world + 4);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> point(point_in_world);
    const Eigen::Matrix<T, 3, 1> point_in_cam = rotation * point + translation;
    if (!(abs(point_in_cam.z()) > T(kMinAbsDepth))) return false;
    const T u = point_in_cam.x() / point_in_cam.z();
    const T v = point_in_cam.y() / point_in_cam.z();
    ProjectNormalized<kModel>(camera_params, u, v, residual);
    residual[0] -= pixel_.x();
    residual[1] -= pixel_.y();
    return true;
  }

 private:
  Eigen::Vector2d pixel_;
};

template <CameraModel kModel>
std::unique_ptr<ceres::CostFunction> Create(const Eigen::Vector2d& pixel) {
  using Cost = ReprojectionCost<kModel>;
  constexpr int kNumParams = NumCameraParams<kModel>();
  return std::make_unique<ceres::AutoDiffCostFunction<Cost, 2, kNumPoseParams, 3, kNumParams>>(
      new Cost(pixel));
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
