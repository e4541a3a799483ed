// SPDX-License-Identifier: BSD-3-Clause
#include "refine/projection.h"

#include "refine/reprojection_cost.h"
#include "tests/support/synthetic_model.h"

#include <cmath>
#include <memory>
#include <random>
#include <string>

#include <ceres/cost_function.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

class EveryCameraModel : public testing::TestWithParam<int> {
 protected:
  CameraModel model() const { return static_cast<CameraModel>(GetParam()); }
};

template <int kModel>
struct CheckCounts {
  static void Run() {
    constexpr CameraModel kCameraModel = static_cast<CameraModel>(kModel);
    const CameraModelInfo& info = GetCameraModelInfo(kCameraModel);
    EXPECT_EQ(NumCameraParams<kCameraModel>(), info.num_params) << info.name;
    EXPECT_EQ(NumFocalLengths<kCameraModel>(), info.num_focal_lengths) << info.name;
    if constexpr (kModel + 1 < kNumCameraModels) CheckCounts<kModel + 1>::Run();
  }
};

TEST(Projection, NumbersOfParametersEqualTheTableOfModels) { CheckCounts<0>::Run(); }

// Pixel by the cost functor: identity pose, residual against pixel (0, 0).
Eigen::Vector2d ProjectByCost(const Camera& camera, const Eigen::Vector3d& point_in_cam) {
  const std::unique_ptr<ceres::CostFunction> cost =
      MakeReprojectionCost(camera.model, Eigen::Vector2d::Zero());
  const double identity[kNumPoseParams] = {0, 0, 0, 1, 0, 0, 0};
  const double* blocks[] = {identity, point_in_cam.data(), camera.params.data()};
  Eigen::Vector2d pixel;
  EXPECT_TRUE(cost->Evaluate(blocks, pixel.data(), nullptr));
  return pixel;
}

TEST_P(EveryCameraModel, EqualsTheProjectionOfTheVocabulary) {
  const Camera camera = MakeTestCamera(model());
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 2000; ++i) {
    // Rays from the optical axis (1e-9) to 60 degrees off it.
    const double size = std::pow(10.0, -4.4 + 4.4 * uniform(random));
    const Eigen::Vector3d point(2.0 * size * uniform(random), 2.0 * size * uniform(random), 1.0);
    const auto expected = Project(camera, point);
    ASSERT_TRUE(expected);
    // Some roundings of a number of the size of the focal length.
    EXPECT_LT((ProjectByCost(camera, point) - *expected).norm(), 1e-12 * (500.0 + expected->norm()))
        << point.transpose();
  }
  EXPECT_EQ(ProjectByCost(camera, {0.0, 0.0, 2.0}), camera.PrincipalPoint());
}

INSTANTIATE_TEST_SUITE_P(Projection,
                         EveryCameraModel,
                         testing::Range(0, kNumCameraModels),
                         [](const testing::TestParamInfo<int>& info) {
                           return std::string(
                               GetCameraModelInfo(static_cast<CameraModel>(info.param)).name);
                         });

}  // namespace
}  // namespace vgtw
