// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/reprojection_cost.h"
#include "scene/rigid3d.h"
#include "tests/support/synthetic_model.h"

#include <array>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <ceres/ceres.h>

namespace vgtw {

// Residual [1]: the distance of a point from a place in the world, over a block [2] of scale and
// offset. A second kind of term with a point, as priors of depth are.
struct DistanceCost {
  Eigen::Vector3d place;
  double distance;

  template <typename T>
  bool operator()(const T* point, const T* scale_and_offset, T* residual) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> X(point);
    residual[0] =
        (X - place.cast<T>()).norm() * scale_and_offset[0] + scale_and_offset[1] - T(distance);
    return true;
  }
};

// Residual [3]: the difference of two translations. A term without a point, as priors of poses are.
struct BaselineCost {
  Eigen::Vector3d baseline;

  template <typename T>
  bool operator()(const T* pose_a, const T* pose_b, T* residual) const {
    for (int i = 0; i < 3; ++i) residual[i] = pose_a[4 + i] - pose_b[4 + i] - T(baseline[i]);
    return true;
  }
};

// A bundle problem with all that a ceres::Problem of this project may hold: a shared camera with
// held parameters and two of their own, a held pose, a held coordinate, an image that sees points
// twice, robust losses, terms of one residual and terms without points. Noise and errors by seed.
class PointProblem {
 public:
  explicit PointProblem(unsigned seed, bool with_loss = true) {
    SyntheticModelOptions options;
    options.num_images = 14;
    options.num_points = 150;
    options.camera_model = CameraModel::kSimpleRadial;
    options.seed = seed;
    Reconstruction model = MakeSyntheticModel(options);
    ProjectAgain(model, 0.5, seed);
    PerturbPoses(model, 0.3, 0.02, seed + 1);
    PerturbPoints(model, 0.02, seed + 2);
    for (auto& [image_id, image] : model.images) poses_.push_back(ToBlock(image.cam_from_world));
    for (auto& [camera_id, camera] : model.cameras) {
      params_.push_back({1.02 * camera.params[0], camera.params[1], camera.params[2], 0.0});
    }
    for (auto& [point3D_id, point] : model.points3D) points.push_back(point.xyz);
    AddReprojections(model, with_loss ? &loss_ : nullptr, seed);
    AddOthers();
    Hold();
  }

  ceres::Problem& problem() { return problem_; }
  std::vector<double> Values() const {
    std::vector<double> values;
    for (const auto& pose : poses_) values.insert(values.end(), pose.begin(), pose.end());
    for (const auto& params : params_) values.insert(values.end(), params.begin(), params.end());
    for (const auto& point : points) values.insert(values.end(), point.begin(), point.end());
    values.insert(values.end(), scale_.begin(), scale_.end());
    return values;
  }

  std::vector<Eigen::Vector3d> points;

 private:
  using Pose = std::array<double, kNumPoseParams>;

  static Pose ToBlock(const Rigid3d& pose) {
    const Eigen::Vector4d& q = pose.rotation.coeffs();
    return {q[0], q[1], q[2], q[3], pose.translation[0], pose.translation[1], pose.translation[2]};
  }

  void AddReprojections(const Reconstruction& model, ceres::LossFunction* loss, unsigned seed) {
    std::mt19937 random(seed);
    for (size_t i = 0; i < poses_.size(); ++i) {
      const Image& image = model.images.at(static_cast<ImageId>(i + 1));
      // Images 0 .. 9 share a camera.
      double* params = params_[i < 10 ? 0 : i].data();
      for (size_t k = 0; k < points.size(); ++k) {
        // Neither all see all, nor in a pattern.
        if (random() % 3 == 0) continue;
        for (int copy = 0; copy < (i == 3 && k % 10 == 0 ? 2 : 1); ++copy) {
          const Eigen::Vector2d pixel = image.points2D[k].xy + Eigen::Vector2d(0.3 * copy, 0.0);
          problem_.AddResidualBlock(
              MakeReprojectionCost(CameraModel::kSimpleRadial, pixel).release(),
              loss,
              poses_[i].data(),
              points[k].data(),
              params);
        }
      }
    }
  }

  void AddOthers() {
    for (size_t k = 0; k < 20; ++k) {
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<DistanceCost, 1, 3, 2>(
                                    new DistanceCost{{0.0, 0.0, -4.0}, 4.0}),
                                &loss_,
                                points[k].data(),
                                scale_.data());
    }
    problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<BaselineCost, 3, kNumPoseParams, kNumPoseParams>(
            new BaselineCost{{0.1, 0.0, 0.2}}),
        nullptr,
        poses_[2].data(),
        poses_[11].data());
  }

  void Hold() {
    using Rotation = ceres::EigenQuaternionManifold;
    for (size_t i = 1; i < poses_.size(); ++i) {
      problem_.SetManifold(poses_[i].data(),
                           new ceres::ProductManifold<Rotation, ceres::EuclideanManifold<3>>());
    }
    problem_.SetParameterBlockConstant(poses_[0].data());
    problem_.SetManifold(poses_[13].data(),
                         new ceres::ProductManifold<Rotation, ceres::SubsetManifold>(
                             Rotation(), ceres::SubsetManifold(3, {0})));
    for (const size_t camera : {size_t{0}, size_t{10}, size_t{12}}) {
      problem_.SetManifold(params_[camera].data(), new ceres::SubsetManifold(4, {1, 2}));
    }
    problem_.SetParameterBlockConstant(params_[13].data());
  }

  static ceres::Problem::Options WithoutLossOwnership() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  ceres::CauchyLoss loss_{1.0};
  ceres::Problem problem_{WithoutLossOwnership()};
  std::vector<Pose> poses_;
  std::vector<std::array<double, 4>> params_;
  std::array<double, 2> scale_ = {1.0, 0.1};
};

}  // namespace vgtw
