// SPDX-License-Identifier: BSD-3-Clause
#include "matching/epipolar_band.h"

#include "matching/relative_pose.h"
#include "scene/random.h"
#include "scene/rigid3d.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr double kMaxErrorPx = 4.0;

// A camera that moves sideways sees features move along their rows.
TEST(EpipolarBand, OfASidewaysMoveIsARow) {
  const Eigen::Matrix3d E = EssentialMatrix({Eigen::Quaterniond::Identity(), {-1.0, 0.0, 0.0}});
  const Camera camera = MakePinhole(640, 480, 500.0, 500.0);
  const EpipolarBand band = EpipolarBand::OfRays(E, camera, kMaxErrorPx);
  const Eigen::Vector2d ray1(0.1, 0.2);  // pixel (370, 340)
  const auto capsule = band.Around({300.0f, 350.0f}, 20.0f, ray1);
  ASSERT_TRUE(capsule);
  // Both views share the error of 4 px alike: its part in one is sqrt(2) as large, and a quarter
  // more for what the line's place may change. So much and 20 pixels to both sides of the expected
  // pixel, on the row of the feature.
  const double distance = 4.0 * std::sqrt(2.0) * 1.25;
  EXPECT_NEAR(std::abs(capsule->end.x() - capsule->start.x()), 2.0 * (20.0 + distance), 1e-3);
  EXPECT_NEAR(0.5 * (capsule->end.x() + capsule->start.x()), 300.0, 1e-3);
  EXPECT_NEAR(capsule->start.y(), 340.0, 1e-3);
  EXPECT_NEAR(capsule->end.y(), 340.0, 1e-3);
  EXPECT_NEAR(capsule->radius, distance, 1e-3);
  EXPECT_FALSE(band.Around({300.0f, 370.0f}, 20.0f, ray1));  // the row passes 30 px away
}

// Law: what has a Sampson distance of at most the error, and is as near as that, is in the band.
TEST(EpipolarBand, HoldsWhatTheEquationAllows) {
  RandomStream random(3);
  Camera camera = MakePinhole(640, 480, 500.0, 500.0);
  camera.model = CameraModel::kSimpleRadial;
  camera.params = {500.0, 320.0, 240.0, -0.15};
  const Eigen::Matrix3d K = (Eigen::Matrix3d() << 500, 0, 320, 0, 500, 240, 0, 0, 1).finished();
  int num_allowed = 0;
  for (int i = 0; i < 20000; ++i) {
    const Rigid3d pose = {RotationAboutAxis(random.NormalVector().normalized(), 5.0),
                          random.NormalVector().normalized()};
    const Eigen::Matrix3d E = EssentialMatrix(pose);
    const Eigen::Matrix3d F = K.transpose().inverse() * E * K.inverse();
    const Eigen::Vector2d pixel1{random.Uniform(100, 540), random.Uniform(80, 400)};
    const Eigen::Vector2f expected{static_cast<float>(random.Uniform(100, 540)),
                                   static_cast<float>(random.Uniform(80, 400))};
    const Eigen::Vector2d pixel2 = expected.cast<double>() + 15.0 * random.NormalVector().head<2>();
    if ((pixel2 - expected.cast<double>()).norm() > 30.0) continue;
    const auto expect_inside = [&](const std::optional<Capsule>& capsule) {
      ++num_allowed;
      ASSERT_TRUE(capsule);
      EXPECT_LE(std::sqrt(capsule->SquaredDistanceToAxis(pixel2.cast<float>())), capsule->radius);
    };
    if (SampsonDistance(F, pixel1, pixel2) <= kMaxErrorPx) {
      expect_inside(EpipolarBand::OfPixels(F, kMaxErrorPx).Around(expected, 30.0f, pixel1));
    }
    const auto ray1 = Unproject(camera, pixel1);
    const auto ray2 = Unproject(camera, pixel2);
    if (!ray1 || !ray2 || SampsonDistance(E, *ray1, *ray2) > kMaxErrorPx / 500.0) continue;
    expect_inside(EpipolarBand::OfRays(E, camera, kMaxErrorPx).Around(expected, 30.0f, *ray1));
  }
  EXPECT_GT(num_allowed, 500);
}

TEST(EpipolarBand, WithoutALineThereIsNone) {
  const EpipolarBand band = EpipolarBand::OfPixels(Eigen::Matrix3d::Zero(), kMaxErrorPx);
  EXPECT_FALSE(band.Around({1.0f, 2.0f}, 10.0f, {3.0, 4.0}));
}

}  // namespace
}  // namespace vgtw
