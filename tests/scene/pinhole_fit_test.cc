// SPDX-License-Identifier: BSD-3-Clause
#include "scene/pinhole_fit.h"

#include "scene/safetensors.h"
#include "scene/statistics.h"
#include "tests/support/shared_data.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Points of the centres of 20x14 pixels through fx = 40, fy = 44, c = (9.5, 8), as bumpy as a
// scene.
Grid<Eigen::Vector3f> ExactPoints() {
  Grid<Eigen::Vector3f> points(20, 14);
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 20; ++x) {
      const double z = 1.0 + 0.3 * ((3 * x + 5 * y) % 7);
      points(x, y) = Eigen::Vector3d((x - 9.0) / 40.0 * z, (y - 7.5) / 44.0 * z, z).cast<float>();
    }
  }
  return points;
}

void ExpectTruth(const std::optional<PinholeFit>& fit) {
  ASSERT_TRUE(fit);
  const Eigen::Matrix3d truth{{40.0, 0.0, 9.5}, {0.0, 44.0, 8.0}, {0.0, 0.0, 1.0}};
  // Points are float: 6e-8 relative.
  EXPECT_LT((fit->intrinsics - truth).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_LT(fit->median_error_px, 1e-5);
}

TEST(FitPinhole, IsExactForExactPoints) {
  ExpectTruth(FitPinhole(ExactPoints(), {}));
  ConfidenceMap weights(20, 14);
  for (size_t i = 0; i < weights.size(); ++i) weights.data()[i] = 0.1f + static_cast<float>(i % 5);
  ExpectTruth(FitPinhole(ExactPoints(), weights));
}

std::vector<float> Floats(const SafetensorsFile& file, const std::string& name) {
  const StoredTensor& tensor = file.tensors().at(name);
  std::vector<float> values(tensor.NumElements());
  std::memcpy(values.data(), tensor.bytes.data(), tensor.bytes.size());
  return values;
}

// pi3's own recovery of intrinsics from noisy rays, whose first pixel lies at (0, 0).
TEST(FitPinhole, EqualsTheOfficialFit) {
  VGTW_NEED_PARITY_DATA();
  const SafetensorsFile file(ParityData() / "ops.safetensors");
  const std::vector<float> rays = Floats(file, "pi3.rays");
  const std::vector<float> official = Floats(file, "pi3.K");
  Grid<Eigen::Vector3f> points(20, 14);
  ASSERT_EQ(rays.size(), 3 * points.size());
  std::memcpy(points.data().front().data(), rays.data(), rays.size() * sizeof(float));
  const auto fit = FitPinhole(points, {});
  ASSERT_TRUE(fit);
  // The official one is in float: 1e-5 relative for sums of 280 terms.
  EXPECT_NEAR(fit->intrinsics(0, 0) / official[0], 1.0, 1e-5);
  EXPECT_NEAR(fit->intrinsics(1, 1) / official[4], 1.0, 1e-5);
  EXPECT_NEAR(fit->intrinsics(0, 2), official[2] + 0.5, 1e-4);
  EXPECT_NEAR(fit->intrinsics(1, 2), official[5] + 0.5, 1e-4);
}

TEST(FitPinhole, PointsThatDoNotCountHaveNoInfluence) {
  Grid<Eigen::Vector3f> points = ExactPoints();
  points(3, 4) = {kNan, 0.0f, 1.0f};
  points(4, 4) = {1.0f, 2.0f, -1.0f};
  points(5, 4) = {1.0f, 2.0f, 0.0f};
  ExpectTruth(FitPinhole(points, {}));
  points(6, 4) = {50.0f, 70.0f, 1.0f};
  points(7, 4) = {50.0f, 70.0f, 1.0f};
  ConfidenceMap weights(20, 14, 1.0f);
  weights(6, 4) = 0.0f;
  weights(7, 4) = kNan;
  ExpectTruth(FitPinhole(points, weights));
}

// The law of weighted least squares: residuals, weighted, sum to nothing, alone and times the ray.
TEST(FitPinhole, ResidualsAreOrthogonalToTheModel) {
  Grid<Eigen::Vector3f> points = ExactPoints();
  ConfidenceMap weights(20, 14);
  for (size_t i = 0; i < points.size(); ++i) {
    const auto k = static_cast<float>(i);
    points.data()[i] += 0.05f * Eigen::Vector3f(std::sin(3 * k), std::cos(2 * k), std::sin(k));
    weights.data()[i] = 0.2f + static_cast<float>(i % 7);
  }
  const auto fit = FitPinhole(points, weights);
  ASSERT_TRUE(fit);
  Eigen::Matrix<double, 4, 1> sums = Eigen::Matrix<double, 4, 1>::Zero();
  std::vector<double> errors;
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 20; ++x) {
      const Eigen::Vector3d ray = points(x, y).cast<double>() / points(x, y).z();
      const Eigen::Vector2d residual =
          (fit->intrinsics * ray).head<2>() - Eigen::Vector2d(x + 0.5, y + 0.5);
      sums.head<2>() += weights(x, y) * residual;
      sums.tail<2>() += weights(x, y) * residual.cwiseProduct(ray.head<2>());
      errors.push_back(residual.norm());
    }
  }
  EXPECT_LT(sums.cwiseAbs().maxCoeff(), 1e-8);  // 280 terms of at most 1e2, rays rounded once more
  EXPECT_NEAR(fit->median_error_px, Median(errors), 1e-9);
  EXPECT_GT(fit->median_error_px, 0.1);
}

TEST(FitPinhole, OpenOrMirroredCamerasAreRefused) {
  EXPECT_FALSE(FitPinhole(Grid<Eigen::Vector3f>(20, 14, Eigen::Vector3f(0, 0, 1)), {}));
  EXPECT_FALSE(FitPinhole(Grid<Eigen::Vector3f>(20, 14, Eigen::Vector3f::Constant(kNan)), {}));
  EXPECT_FALSE(FitPinhole(ExactPoints(), ConfidenceMap(20, 14, 0.0f)));
  Grid<Eigen::Vector3f> mirrored = ExactPoints();
  for (Eigen::Vector3f& point : mirrored.data()) point.x() = -point.x();
  EXPECT_FALSE(FitPinhole(mirrored, {}));
  EXPECT_THROW(FitPinhole(ExactPoints(), ConfidenceMap(3, 3, 1.0f)), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
