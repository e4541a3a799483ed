// SPDX-License-Identifier: BSD-3-Clause
#include "refine/reprojection_cost.h"

#include "scene/rigid3d.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <ceres/gradient_checker.h>
#include <ceres/manifold.h>
#include <ceres/product_manifold.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

class EveryCameraModel : public testing::TestWithParam<int> {
 protected:
  CameraModel model() const { return static_cast<CameraModel>(GetParam()); }
};

// The two-dimensional residual of a point at known parameters.
struct Blocks {
  Camera camera;
  double pose[kNumPoseParams] = {0.1, -0.2, 0.05, 0.0, 0.3, -0.1, 4.0};
  double point[3] = {0.7, -0.4, 0.2};

  explicit Blocks(CameraModel model) : camera(MakeTestCamera(model)) {
    Eigen::Map<Eigen::Quaterniond> rotation(pose);
    rotation.w() = 1.0;
    rotation.normalize();
  }
  std::vector<const double*> pointers() const { return {pose, point, camera.params.data()}; }
  Eigen::Vector2d Pixel() const {
    const Rigid3d cam_from_world = {Eigen::Quaterniond(pose[3], pose[0], pose[1], pose[2]),
                                    {pose[4], pose[5], pose[6]}};
    return *Project(camera, cam_from_world * Eigen::Vector3d(point[0], point[1], point[2]));
  }
};

TEST_P(EveryCameraModel, ResidualIsZeroAtTheTruth) {
  const Blocks blocks(model());
  const std::unique_ptr<ceres::CostFunction> cost = MakeReprojectionCost(model(), blocks.Pixel());
  double residual[2];
  ASSERT_TRUE(cost->Evaluate(blocks.pointers().data(), residual, nullptr));
  EXPECT_NEAR(residual[0], 0.0, 1e-12 * 500.0);
  EXPECT_NEAR(residual[1], 0.0, 1e-12 * 500.0);
}

TEST_P(EveryCameraModel, DerivativesEqualFiniteDifferences) {
  const Blocks blocks(model());
  const std::unique_ptr<ceres::CostFunction> cost =
      MakeReprojectionCost(model(), blocks.Pixel() + Eigen::Vector2d(3.0, -2.0));
  const ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>> pose;
  const std::vector<const ceres::Manifold*> manifolds = {&pose, nullptr, nullptr};
  const ceres::GradientChecker checker(cost.get(), &manifolds, ceres::NumericDiffOptions());
  ceres::GradientChecker::ProbeResults results;
  // Relative; Ridders' method reaches about 1e-9 on entries of very different sizes.
  EXPECT_TRUE(checker.Probe(blocks.pointers().data(), 1e-7, &results)) << results.error_log;
}

// At the optical axis the fisheyes' radius is zero, where a square root has no derivative.
TEST_P(EveryCameraModel, DerivativesAreFiniteOnTheOpticalAxis) {
  const Camera camera = MakeTestCamera(model());
  const std::unique_ptr<ceres::CostFunction> cost =
      MakeReprojectionCost(model(), Eigen::Vector2d::Zero());
  const double identity[kNumPoseParams] = {0, 0, 0, 1, 0, 0, 0};
  const double point[3] = {0.0, 0.0, 2.0};
  const double* blocks[] = {identity, point, camera.params.data()};
  double residual[2];
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> by_params(2, camera.params.size());
  double* jacobians[] = {nullptr, by_point.data(), by_params.data()};
  ASSERT_TRUE(cost->Evaluate(blocks, residual, jacobians));
  EXPECT_TRUE(by_params.allFinite());
  // d(pixel)/d(x) = f / z; the field-of-view model stretches the centre by 2 tan(omega/2) / omega.
  const double stretch = model() == CameraModel::kFOV ? 2.0 * std::tan(0.2) / 0.4 : 1.0;
  EXPECT_NEAR(by_point(0, 0), stretch * camera.FocalLengthX() / 2.0, 1e-9);
  EXPECT_NEAR(by_point(1, 1), stretch * camera.FocalLengthY() / 2.0, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(ReprojectionCost,
                         EveryCameraModel,
                         testing::Range(0, kNumCameraModels),
                         [](const testing::TestParamInfo<int>& info) {
                           return std::string(
                               GetCameraModelInfo(static_cast<CameraModel>(info.param)).name);
                         });

TEST(ReprojectionCost, HasNoValueInTheCamerasPlane) {
  const Camera camera = MakeTestCamera(CameraModel::kPinhole);
  const std::unique_ptr<ceres::CostFunction> cost =
      MakeReprojectionCost(camera.model, Eigen::Vector2d::Zero());
  const double identity[kNumPoseParams] = {0, 0, 0, 1, 0, 0, 0};
  double residual[2];
  for (const double z : {0.0, std::numeric_limits<double>::quiet_NaN()}) {
    const double point[3] = {1.0, 1.0, z};
    const double* blocks[] = {identity, point, camera.params.data()};
    EXPECT_FALSE(cost->Evaluate(blocks, residual, nullptr));
  }
}

}  // namespace
}  // namespace vgtw
