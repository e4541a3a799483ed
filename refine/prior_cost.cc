// SPDX-License-Identifier: BSD-3-Clause
#include "refine/prior_cost.h"

#include "refine/reprojection_cost.h"

#include <algorithm>
#include <cmath>

#include <ceres/autodiff_cost_function.h>
#include <ceres/rotation.h>

namespace vgtw {
namespace {

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using ConstQuaternionMap = Eigen::Map<const Eigen::Quaternion<T>>;
template <typename T>
using ConstVector3Map = Eigen::Map<const Vector3<T>>;

class RotationPriorCost {
 public:
  RotationPriorCost(const Eigen::Quaterniond& cam_from_reference, double weight)
      : reference_from_cam_(cam_from_reference.conjugate()), weight_(weight) {}

  template <typename T>
  bool operator()(const T* cam_from_world, const T* reference_from_world, T* residual) const {
    const Eigen::Quaternion<T> error = ConstQuaternionMap<T>(cam_from_world) *
                                       ConstQuaternionMap<T>(reference_from_world).conjugate() *
                                       reference_from_cam_.cast<T>();
    const T wxyz[4] = {error.w(), error.x(), error.y(), error.z()};
    ceres::QuaternionToAngleAxis(wxyz, residual);
    for (int i = 0; i < 3; ++i) residual[i] *= T(weight_);
    return true;
  }

 private:
  Eigen::Quaterniond reference_from_cam_;
  double weight_;
};

class CentrePriorCost {
 public:
  CentrePriorCost(const Eigen::Vector3d& centre_in_reference, const Eigen::Vector3d& weights)
      : centre_(centre_in_reference), weights_(weights) {}

  template <typename T>
  bool operator()(const T* cam_from_world, const T* reference_from_world, T* residual) const {
    using std::exp;
    const Vector3<T> centre = -(ConstQuaternionMap<T>(cam_from_world).conjugate() *
                                ConstVector3Map<T>(cam_from_world + 4));
    const Vector3<T> in_reference =
        exp(reference_from_world[7]) * (ConstQuaternionMap<T>(reference_from_world) * centre) +
        ConstVector3Map<T>(reference_from_world + 4);
    for (int i = 0; i < 3; ++i) residual[i] = weights_[i] * (centre_[i] - in_reference[i]);
    return true;
  }

 private:
  Eigen::Vector3d centre_;
  Eigen::Vector3d weights_;
};

// By hand, because the size of the block depends on the camera model.
class FocalPriorCost : public ceres::CostFunction {
 public:
  FocalPriorCost(const CameraModelInfo& model, const Eigen::Vector2d& focal_lengths, double weight)
      : num_params_(model.num_params), focal_lengths_(focal_lengths), weight_(weight) {
    if (model.num_focal_lengths == 1) focal_lengths_.setConstant(focal_lengths.mean());
    set_num_residuals(model.num_focal_lengths);
    mutable_parameter_block_sizes()->push_back(num_params_);
  }

  bool Evaluate(const double* const* blocks, double* residuals, double** jacobians) const override {
    const double* params = blocks[0];
    double* jacobian = jacobians ? jacobians[0] : nullptr;
    if (jacobian) std::fill_n(jacobian, num_residuals() * num_params_, 0.0);
    for (int i = 0; i < num_residuals(); ++i) {
      if (!(params[i] > 0.0)) return false;
      residuals[i] = weight_ * std::log(params[i] / focal_lengths_[i]);
      if (jacobian) jacobian[i * num_params_ + i] = weight_ / params[i];
    }
    return true;
  }

 private:
  int num_params_;
  Eigen::Vector2d focal_lengths_;
  double weight_;
};

// log(x), below 1/100 its tangent there.
template <typename T>
T ExtendedLog(const T& x) {
  using std::log;
  constexpr double kLeast = 0.01;
  if (x > T(kLeast)) return log(x);
  return T(std::log(kLeast)) + (x - T(kLeast)) / T(kLeast);
}

class DepthPriorCost {
 public:
  DepthPriorCost(double depth, double median_depth, double weight)
      : log_relative_depth_(std::log(depth / median_depth)),
        median_depth_(median_depth),
        weight_(weight) {}

  template <typename T>
  bool operator()(const T* cam_from_world,
                  const T* point_in_world,
                  const T* log_scale,
                  const T* view,
                  T* residual) const {
    using std::exp;
    const Vector3<T> point_in_cam =
        ConstQuaternionMap<T>(cam_from_world) * ConstVector3Map<T>(point_in_world) +
        ConstVector3Map<T>(cam_from_world + 4);
    const T unshifted = point_in_cam.z() * exp(-log_scale[0]) / median_depth_ - view[1];
    residual[0] = weight_ * (ExtendedLog(unshifted) - view[0] - log_relative_depth_);
    return true;
  }

 private:
  double log_relative_depth_;
  double median_depth_;
  double weight_;
};

}  // namespace

std::unique_ptr<ceres::CostFunction> MakeRotationPriorCost(
    const Eigen::Quaterniond& cam_from_reference, double weight) {
  using Cost =
      ceres::AutoDiffCostFunction<RotationPriorCost, 3, kNumPoseParams, kNumSimilarityParams>;
  return std::make_unique<Cost>(new RotationPriorCost(cam_from_reference, weight));
}

std::unique_ptr<ceres::CostFunction> MakeCentrePriorCost(const Eigen::Vector3d& centre_in_reference,
                                                         const Eigen::Vector3d& weights) {
  using Cost =
      ceres::AutoDiffCostFunction<CentrePriorCost, 3, kNumPoseParams, kNumSimilarityParams>;
  return std::make_unique<Cost>(new CentrePriorCost(centre_in_reference, weights));
}

std::unique_ptr<ceres::CostFunction> MakeFocalPriorCost(CameraModel model,
                                                        const Eigen::Vector2d& focal_lengths,
                                                        double weight) {
  return std::make_unique<FocalPriorCost>(GetCameraModelInfo(model), focal_lengths, weight);
}

std::unique_ptr<ceres::CostFunction> MakeDepthPriorCost(double depth,
                                                        double median_depth,
                                                        double weight) {
  using Cost = ceres::AutoDiffCostFunction<DepthPriorCost, 1, kNumPoseParams, 3, 1, 2>;
  return std::make_unique<Cost>(new DepthPriorCost(depth, median_depth, weight));
}

}  // namespace vgtw
