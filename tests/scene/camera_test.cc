// SPDX-License-Identifier: BSD-3-Clause
#include "scene/camera.h"

#include "tests/scene/sample_cameras.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Camera MakeCamera(CameraModel model, std::vector<double> params) {
  Camera camera;
  camera.model = model;
  camera.width = 100;
  camera.height = 80;
  camera.params = std::move(params);
  return camera;
}

// The ray of (1, 2, 2) is (0.5, 1) with r^2 = 1.25. The first four are exact in decimals; the rest
// was evaluated with 16 digits outside this program from COLMAP's published formulas.
// Tolerance: a few roundings of numbers of size 200.
void ExpectPixel(CameraModel model, std::vector<double> params, double x, double y) {
  const auto pixel = Project(MakeCamera(model, std::move(params)), {1.0, 2.0, 2.0});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), x, 1e-11);
  EXPECT_NEAR(pixel->y(), y, 1e-11);
}

TEST(Camera, ProjectsHandComputedPointsThroughPerspectiveModels) {
  ExpectPixel(CameraModel::kSimplePinhole, {100, 50, 40}, 100.0, 140.0);
  ExpectPixel(CameraModel::kPinhole, {100, 200, 50, 40}, 100.0, 240.0);
  ExpectPixel(CameraModel::kSimpleRadial, {100, 50, 40, 0.1}, 106.25, 152.5);
  ExpectPixel(CameraModel::kRadial, {100, 50, 40, 0.1, 0.01}, 107.03125, 154.0625);
  ExpectPixel(
      CameraModel::kOpenCV, {100, 200, 50, 40, 0.1, 0.01, 0.001, 0.002}, 107.48125, 269.175);
  // Radial factor (1 + 0.125 + 0.015625 + 0.015625) / (1 + 0.1 + 0.05 + 0.1) = 0.925.
  ExpectPixel(CameraModel::kFullOpenCV,
              {100, 200, 50, 40, 0.1, 0.01, 0.001, 0.002, 0.008, 0.08, 0.032, 0.0512},
              96.7,
              226.05);
}

TEST(Camera, ProjectsHandComputedPointsThroughFisheyes) {
  ExpectPixel(
      CameraModel::kSimpleRadialFisheye, {100, 50, 40, 0.1}, 90.27451686334933, 120.54903372669867);
  ExpectPixel(
      CameraModel::kRadialFisheye, {100, 50, 40, 0.1, 0.01}, 90.46273968421781, 120.92547936843563);
  ExpectPixel(CameraModel::kOpenCVFisheye,
              {100, 200, 50, 40, 0.1, 0.01, 0.001, 0.0001},
              90.47699638632999,
              201.90798554531995);
  ExpectPixel(CameraModel::kFOV, {100, 200, 50, 40, 1.0}, 89.56968246607667, 198.27872986430668);
  ExpectPixel(CameraModel::kThinPrismFisheye,
              {100, 200, 50, 40, 0.1, 0.01, 0.001, 0.002, 0.001, 0.0001, 0.003, 0.004},
              90.94387808201319,
              203.06811581944183);
}

TEST(Camera, FOVWithoutOmegaIsPinhole) {
  const Eigen::Vector3d point(1.0, 2.0, 2.0);
  const Camera none = MakeCamera(CameraModel::kFOV, {100, 200, 50, 40, 0.0});
  EXPECT_EQ(Project(none, point), Eigen::Vector2d(100.0, 240.0));
  EXPECT_EQ(Unproject(none, {100.0, 240.0}), Eigen::Vector2d(0.5, 1.0));
  // The factor's first terms are 1 + omega^2 (1/12 - r^2/3), here 1 - omega^2/3.
  const Camera tiny = MakeCamera(CameraModel::kFOV, {100, 200, 50, 40, 1e-3});
  EXPECT_NEAR(Project(tiny, point)->y(), 240.0 - 200.0 * 1e-6 / 3.0, 1e-9);
}

TEST(Camera, UnprojectInvertsProjectOnEveryPixelOfEveryModel) {
  for (const Camera& camera : SampleCameras()) {
    SCOPED_TRACE(GetCameraModelInfo(camera.model).name);
    for (double y = 0.0; y <= 480.0; y += 7.5) {
      for (double x = 0.0; x <= 640.0; x += 8.0) {
        const Eigen::Vector2d pixel(x, y);
        const auto ray = Unproject(camera, pixel);
        ASSERT_TRUE(ray) << pixel.transpose();
        const auto again = Project(camera, 3.0 * ray->homogeneous());
        ASSERT_TRUE(again) << pixel.transpose();
        // The bound that camera.h promises.
        ASSERT_LE((*again - pixel).norm(), 1e-10) << pixel.transpose();
      }
    }
  }
}

TEST(Camera, ProjectInvertsUnprojectOnRays) {
  for (const Camera& camera : SampleCameras()) {
    SCOPED_TRACE(GetCameraModelInfo(camera.model).name);
    for (double v = -0.4; v <= 0.4; v += 0.05) {
      for (double u = -0.55; u <= 0.55; u += 0.05) {
        const Eigen::Vector2d ray(u, v);
        const auto pixel = Project(camera, ray.homogeneous());
        ASSERT_TRUE(pixel);
        const auto again = Unproject(camera, *pixel);
        ASSERT_TRUE(again);
        // 1e-10 px are below 1e-12 of a ray at these focal lengths; the distortion stretches it.
        ASSERT_LE((*again - ray).norm(), 1e-11) << ray.transpose();
      }
    }
  }
}

TEST(Camera, PrincipalPointIsTheOpticalAxis) {
  for (const Camera& camera : SampleCameras()) {
    EXPECT_EQ(Project(camera, {0.0, 0.0, 2.0}), camera.PrincipalPoint());
    EXPECT_EQ(Unproject(camera, camera.PrincipalPoint()), Eigen::Vector2d(0.0, 0.0));
  }
}

TEST(Camera, PointsNotInFrontHaveNoPixel) {
  for (const Camera& camera : SampleCameras()) {
    EXPECT_FALSE(Project(camera, {0.1, 0.1, 0.0}));
    EXPECT_FALSE(Project(camera, {0.1, 0.1, -1.0}));
    EXPECT_FALSE(Project(camera, {0.1, 0.1, kNaN}));
    EXPECT_FALSE(Project(camera, {kNaN, 0.1, 1.0}));
    EXPECT_FALSE(Project(camera, {1e300, 0.1, 1e-300}));
  }
}

TEST(Camera, FoldOfBarrelDistortionEndsTheInverse) {
  // r (1 - 0.3 r^2) grows up to r = 1 / sqrt(0.9) = 1.05409, where it is 0.702728.
  const Camera camera = MakeCamera(CameraModel::kSimpleRadial, {100, 0, 0, -0.3});
  const auto inside = Unproject(camera, {70.2727, 0.0});
  ASSERT_TRUE(inside);
  EXPECT_LT(inside->x(), 1.05409256);
  EXPECT_NEAR(Project(camera, inside->homogeneous())->x(), 70.2727, 1e-10);
  EXPECT_FALSE(Unproject(camera, {70.2729, 0.0}));
  EXPECT_FALSE(Unproject(camera, {500.0, 300.0}));
}

TEST(Camera, InverseStaysOnTheNearSideOfAFold) {
  // r (1 - r^2 + 0.25 r^4) rises to 0.286 at r = 0.632, falls to 0 at r = 1.414 and rises again:
  // the pixel at radius 0.2 has three preimages, of which only the one near the axis is the lens.
  const Camera camera = MakeCamera(CameraModel::kRadial, {100, 0, 0, -1.0, 0.25});
  for (const double radius : {5.0, 20.0, 28.0}) {
    const auto ray = Unproject(camera, {0.6 * radius, 0.8 * radius});
    ASSERT_TRUE(ray) << radius;
    EXPECT_LT(ray->norm(), 0.6325) << radius;
  }
  EXPECT_FALSE(Unproject(camera, {100.0, 0.0}));
}

TEST(Camera, FisheyePixelsBeyondTheHalfSpaceHaveNoRay) {
  // Equidistant: 90 degrees lie at radius 100 pi / 2 = 157.08.
  const Camera camera = MakeCamera(CameraModel::kSimpleRadialFisheye, {100, 0, 0, 0.0});
  const auto ray = Unproject(camera, {157.0, 0.0});
  ASSERT_TRUE(ray);
  EXPECT_NEAR(std::atan(ray->x()), 1.57, 1e-13);
  EXPECT_FALSE(Unproject(camera, {157.1, 0.0}));
  const Camera fov = MakeCamera(CameraModel::kFOV, {100, 100, 0, 0, 1.0});
  EXPECT_TRUE(Unproject(fov, {157.0, 0.0}));
  EXPECT_FALSE(Unproject(fov, {157.1, 0.0}));
}

TEST(Camera, UnprojectRefusesPixelsThatAreNotFinite) {
  for (const Camera& camera : SampleCameras()) {
    EXPECT_FALSE(Unproject(camera, {kNaN, 1.0}));
    EXPECT_FALSE(Unproject(camera, {1.0, std::numeric_limits<double>::infinity()}));
  }
}

TEST(Camera, RescaleScalesProjectionsInEveryModel) {
  for (const Camera& camera : SampleCameras()) {
    SCOPED_TRACE(GetCameraModelInfo(camera.model).name);
    for (const auto& [width, height] : {std::pair(320, 240), std::pair(960, 480)}) {
      const Camera scaled = Rescale(camera, width, height);
      EXPECT_EQ(scaled.width, width);
      EXPECT_EQ(scaled.height, height);
      EXPECT_EQ(FindFault(scaled), "");
      for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.4, -0.3, 1), {-0.1, 0.4, 1}}) {
        const Eigen::Vector2d scale(width / 640.0, height / 480.0);
        // Roundings of numbers of size 1000.
        EXPECT_LE((*Project(scaled, point) - scale.cwiseProduct(*Project(camera, point))).norm(),
                  1e-11);
      }
    }
  }
}

TEST(Camera, RescaleKeepsTheModelUnlessStretched) {
  for (const Camera& camera : SampleCameras()) {
    EXPECT_EQ(Rescale(camera, 320, 240).model, camera.model);
    EXPECT_EQ(Rescale(camera, camera.width, camera.height), camera);
  }
  const Camera radial = MakeCamera(CameraModel::kRadial, {100, 50, 40, 0.1, 0.01});
  const Camera stretched = Rescale(radial, 200, 80);
  EXPECT_EQ(stretched.model, CameraModel::kOpenCV);
  EXPECT_THAT(stretched.params, testing::ElementsAre(200, 100, 100, 40, 0.1, 0.01, 0, 0));
}

TEST(Camera, PinholeInAnotherModelProjectsTheSame) {
  const Camera pinhole = MakePinhole(640, 480, 500.0, 500.0);
  const Eigen::Vector3d point(0.3, -0.4, 1.5);
  for (const char* name : {"SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV"}) {
    const Camera converted = PinholeInModel(pinhole, *FindCameraModel(name));
    EXPECT_EQ(FindFault(converted), "") << name;
    EXPECT_EQ(*Project(converted, point), *Project(pinhole, point)) << name;
  }
  EXPECT_EQ(PinholeInModel(MakePinhole(640, 480, 500.0, 502.0), CameraModel::kSimpleRadial).params,
            (std::vector<double>{501.0, 320.0, 240.0, 0.0}));
  EXPECT_THROW(PinholeInModel(pinhole, CameraModel::kOpenCVFisheye), std::invalid_argument);
  EXPECT_THROW(PinholeInModel(PinholeInModel(pinhole, CameraModel::kRadial), CameraModel::kPinhole),
               std::invalid_argument);
}

TEST(Camera, TableHoldsColmapsNamesAndSizes) {
  for (int model_id = 0; model_id < kNumCameraModels; ++model_id) {
    const CameraModelInfo& info = GetCameraModelInfo(static_cast<CameraModel>(model_id));
    EXPECT_EQ(static_cast<int>(info.model), model_id);
    EXPECT_EQ(FindCameraModel(info.name), info.model);
    EXPECT_EQ(FindCameraModel(model_id), info.model);
  }
  EXPECT_EQ(FindCameraModel("THIN_PRISM_FISHEYE"), CameraModel::kThinPrismFisheye);
  EXPECT_FALSE(FindCameraModel("thin_prism_fisheye"));
  EXPECT_FALSE(FindCameraModel(-1));
  EXPECT_FALSE(FindCameraModel(kNumCameraModels));
  EXPECT_THROW(GetCameraModelInfo(static_cast<CameraModel>(99)), std::invalid_argument);
}

TEST(Camera, AccessorsFollowTheOrderOfParameters) {
  Camera two = MakeCamera(CameraModel::kOpenCV, {100, 200, 50, 40, 1, 2, 3, 4});
  EXPECT_EQ(two.FocalLengthX(), 100);
  EXPECT_EQ(two.FocalLengthY(), 200);
  EXPECT_EQ(two.MeanFocalLength(), 150);
  EXPECT_EQ(two.FirstExtraParamIdx(), 4u);
  two.SetFocalLength(110, 210);
  two.SetPrincipalPoint({51, 41});
  EXPECT_THAT(two.params, testing::ElementsAre(110, 210, 51, 41, 1, 2, 3, 4));
  Camera one = MakeCamera(CameraModel::kRadial, {100, 50, 40, 1, 2});
  EXPECT_EQ(one.FocalLengthY(), 100);
  EXPECT_EQ(one.FirstExtraParamIdx(), 3u);
  one.SetFocalLength(110, 210);
  one.SetPrincipalPoint({51, 41});
  EXPECT_THAT(one.params, testing::ElementsAre(160, 51, 41, 1, 2));
  EXPECT_THAT(MakePinhole(101, 80, 90, 95).params, testing::ElementsAre(90, 95, 50.5, 40));
}

TEST(Camera, FaultsAreNamed) {
  for (const Camera& camera : SampleCameras()) EXPECT_EQ(FindFault(camera), "");
  const Camera good = MakePinhole(100, 80, 90, 95);
  Camera camera = good;
  camera.params.pop_back();
  EXPECT_EQ(FindFault(camera), "PINHOLE has 3 parameters, must have 4");
  EXPECT_THROW(camera.FocalLengthX(), std::invalid_argument);
  EXPECT_THROW(Project(camera, {0, 0, 1}), std::invalid_argument);
  camera = good;
  camera.params[2] = kNaN;
  EXPECT_EQ(FindFault(camera), "a parameter is not finite");
  camera = good;
  camera.params[1] = 0.0;
  EXPECT_EQ(FindFault(camera), "focal length is not positive");
  camera = good;
  camera.height = 0;
  EXPECT_EQ(FindFault(camera), "image size 100 x 0, must be between 1 and 1048576");
  camera.height = uint64_t{1} << 40;
  EXPECT_THAT(FindFault(camera), testing::HasSubstr("1099511627776"));
  camera.model = static_cast<CameraModel>(11);
  EXPECT_EQ(FindFault(camera), "unknown camera model 11");
  camera.model = static_cast<CameraModel>(-1);
  EXPECT_EQ(FindFault(camera), "unknown camera model -1");
}

}  // namespace
}  // namespace vgtw
