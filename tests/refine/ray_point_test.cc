// SPDX-License-Identifier: BSD-3-Clause
#include "refine/ray_point.h"

#include "scene/random.h"
#include "scene/sim3d.h"
#include "tests/scene/sample_cameras.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using Pointers = std::vector<const PixelRay*>;

Pointers PointersTo(const std::vector<PixelRay>& rays) {
  Pointers pointers;
  for (const PixelRay& ray : rays) pointers.push_back(&ray);
  return pointers;
}

// Cameras about 4 units from the origin that look at it from one side, and a point near the origin.
struct Bundle {
  Camera camera = MakePinhole(640, 480, 500.0, 500.0);
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  std::vector<Rigid3d> poses;

  Bundle(int num_rays, uint64_t seed) {
    RandomStream random(HashKey({seed, 1}));
    point = 0.3 * random.NormalVector();
    for (int i = 0; i < num_rays; ++i) {
      Eigen::Vector3d centre(0.0, 0.0, -4.0);
      centre += 0.7 * random.NormalVector();
      poses.push_back(LookAt(centre, 0.1 * random.NormalVector(), {0.0, -1.0, 0.0}));
    }
  }

  Eigen::Vector2d Pixel(size_t i) const { return Project(camera, poses[i] * point).value(); }

  // Rays through the point's pixels plus noise; the first `num_wild` go through random pixels that
  // are at least 60 px away from it.
  std::vector<PixelRay> Rays(double noise_px, size_t num_wild, uint64_t seed) const {
    RandomStream random(HashKey({seed, 2}));
    std::vector<PixelRay> rays;
    for (size_t i = 0; i < poses.size(); ++i) {
      Eigen::Vector2d pixel = Pixel(i) + noise_px * random.NormalVector().head<2>();
      while (i < num_wild && (pixel - Pixel(i)).norm() < 60.0) {
        const double x = random.Uniform(0.0, 640.0);
        pixel = {x, random.Uniform(0.0, 480.0)};
      }
      rays.push_back(MakePixelRay(camera, poses[i], pixel).value());
    }
    return rays;
  }
};

double Cost(const Pointers& rays, const Eigen::Vector3d& point, double scale_px) {
  double cost = 0.0;
  for (const PixelRay* ray : rays) {
    const double ratio = std::min(ErrorPx(*ray, point) / scale_px, 1e4);
    cost += std::log1p(ratio * ratio);
  }
  return cost;
}

// Descends by trying steps along random directions until a step of 1e-10 does not help.
double MinimumNear(const Pointers& rays, Eigen::Vector3d point, double scale_px) {
  RandomStream random(3);
  double cost = Cost(rays, point, scale_px);
  for (double step = 0.1; step > 1e-10; step *= 0.7) {
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d other = point + step * random.NormalVector();
      const double other_cost = Cost(rays, other, scale_px);
      if (other_cost >= cost) continue;
      point = other;
      cost = other_cost;
    }
  }
  return cost;
}

TEST(PixelRay, ErrorIsThatOfTheLensToFirstOrder) {
  RandomStream random(4);
  for (const Camera& camera : SampleCameras()) {
    SCOPED_TRACE(GetCameraModelInfo(camera.model).name);
    for (int i = 0; i < 200; ++i) {
      const double x = random.Uniform(10.0, 630.0);
      const Eigen::Vector2d pixel(x, random.Uniform(10.0, 470.0));
      const Rigid3d cam_from_world = {random.Rotation(), random.NormalVector()};
      const auto ray = MakePixelRay(camera, cam_from_world, pixel);
      ASSERT_TRUE(ray);
      const double depth = random.Uniform(0.5, 50.0);
      // About 1 px, and 0.01 px, at any depth.
      const Eigen::Vector3d offset = 0.002 * depth * random.NormalVector();
      for (const double share : {1.0, 0.01}) {
        const Eigen::Vector3d point = ray->centre + depth * ray->direction + share * offset;
        const double error_px = (Project(camera, cam_from_world * point).value() - pixel).norm();
        // The second order: twice the error per focal length, times the bend of the lens.
        EXPECT_NEAR(ErrorPx(*ray, point), error_px, 5.0 * error_px * error_px / 260.0 + 1e-7);
      }
    }
  }
}

TEST(PixelRay, ErrorIsZeroOnTheRayAndInfiniteBehindTheCamera) {
  for (const Camera& camera : SampleCameras()) {
    const auto ray =
        MakePixelRay(camera, {RotationAboutAxis({0, 1, 0}, 70.0), {1, 2, 3}}, {40, 60});
    ASSERT_TRUE(ray);
    for (const double distance : {0.1, 1.0, 1e4}) {
      // Coordinates of 1e4 are stored to 1e-12, that is 1e-16 of the distance.
      EXPECT_LT(ErrorPx(*ray, ray->centre + distance * ray->direction), 1e-9);
      EXPECT_EQ(ErrorPx(*ray, ray->centre - distance * ray->direction),
                std::numeric_limits<double>::infinity());
    }
    // Along the ray, yet behind the plane of the camera.
    const Eigen::Vector3d side = (ray->direction - 3.0 * ray->axis).normalized();
    EXPECT_EQ(ErrorPx(*ray, ray->centre + side), std::numeric_limits<double>::infinity());
  }
}

TEST(PixelRay, PixelsWithoutARayHaveNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Camera& camera : SampleCameras()) {
    EXPECT_FALSE(MakePixelRay(camera, {}, {nan, 10.0}));
  }
  // r (1 + k r^2) with k < 0 has no value above sqrt(4 / (27 |k|)) = 0.86.
  Camera camera = SampleCameras()[static_cast<int>(CameraModel::kSimpleRadial)];
  EXPECT_TRUE(MakePixelRay(camera, {}, {322.0 + 0.8 * 500.0, 237.0}));
  EXPECT_FALSE(MakePixelRay(camera, {}, {322.0 + 0.9 * 500.0, 237.0}));
}

TEST(EstimateRayPoint, IsExactOnExactRays) {
  for (const Camera& camera : SampleCameras()) {
    for (int num_rays = 2; num_rays <= 10; ++num_rays) {
      Bundle bundle(num_rays, static_cast<uint64_t>(num_rays));
      bundle.camera = camera;
      const std::vector<PixelRay> rays = bundle.Rays(0.0, 0, 0);
      const auto point = EstimateRayPoint(PointersTo(rays), 2.0);
      ASSERT_TRUE(point);
      // Unproject is exact to 1e-10 px of 260, at a distance of 4, and rays meet at some degrees.
      EXPECT_LT((*point - bundle.point).norm(), 1e-9);
    }
  }
}

// A wild ray at 60 px or more pulls like one of scale^2 / 60 px that fits.
TEST(EstimateRayPoint, UpToFortyPercentWildRaysHardlyCount) {
  for (uint64_t seed = 0; seed < 300; ++seed) {
    const Bundle bundle(10, seed);
    for (size_t num_wild = 1; num_wild <= 4; ++num_wild) {
      const std::vector<PixelRay> rays = bundle.Rays(0.0, num_wild, seed);
      const auto point = EstimateRayPoint(PointersTo(rays), 2.0);
      ASSERT_TRUE(point);
      for (size_t i = num_wild; i < rays.size(); ++i) {
        EXPECT_LT(ErrorPx(rays[i], *point), 0.3) << seed << ", " << num_wild << " wild";
      }
    }
  }
}

TEST(EstimateRayPoint, IsTheOptimumOfItsCost) {
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const Bundle bundle(9, seed);
    const std::vector<PixelRay> rays = bundle.Rays(1.0, seed % 4, seed);
    const Pointers pointers = PointersTo(rays);
    const auto point = EstimateRayPoint(pointers, 2.0);
    ASSERT_TRUE(point);
    const double cost = Cost(pointers, *point, 2.0);
    // The last step changes the cost by less than 1e-9 of it; convergence is linear at worst.
    EXPECT_LT(cost, (1.0 + 1e-6) * MinimumNear(pointers, *point, 2.0)) << seed;
    EXPECT_LT(cost, (1.0 + 1e-6) * MinimumNear(pointers, bundle.point, 2.0)) << seed;
  }
}

TEST(EstimateRayPoint, MovesWithTheWorld) {
  RandomStream random(5);
  for (uint64_t seed = 0; seed < 40; ++seed) {
    Bundle bundle(7, seed);
    const std::vector<PixelRay> rays = bundle.Rays(1.0, 2, seed);
    const auto point = EstimateRayPoint(PointersTo(rays), 2.0);
    const double scale = std::exp(random.Uniform(-6.0, 6.0));
    const Sim3d b_from_a = {scale, random.Rotation(), 10.0 * scale * random.NormalVector()};
    std::vector<PixelRay> moved;
    for (size_t i = 0; i < rays.size(); ++i) {
      const auto pixel =
          Project(bundle.camera, bundle.poses[i] * (rays[i].centre + rays[i].direction));
      const Rigid3d cam_from_b = TransformCamera(b_from_a, bundle.poses[i]);
      moved.push_back(MakePixelRay(bundle.camera, cam_from_b, *pixel).value());
    }
    const auto moved_point = EstimateRayPoint(PointersTo(moved), 2.0);
    ASSERT_TRUE(point && moved_point);
    // Where the last step ends depends on rounding: costs equal to 1e-9, points to its root.
    EXPECT_LT((*moved_point - b_from_a * *point).norm() / scale, 1e-4) << seed;
  }
}

TEST(EstimateRayPoint, AStartIsOneMoreHypothesis) {
  const Bundle bundle(6, 7);
  const std::vector<PixelRay> rays = bundle.Rays(0.0, 0, 0);
  const Pointers pointers = PointersTo(rays);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Eigen::Vector3d& start : {Eigen::Vector3d(50.0, -20.0, 30.0),
                                       Eigen::Vector3d(0.0, 0.0, -100.0),
                                       Eigen::Vector3d(nan, nan, nan),
                                       rays[0].centre}) {
    const auto point = EstimateRayPoint(pointers, 2.0, start);
    ASSERT_TRUE(point);
    EXPECT_LT((*point - bundle.point).norm(), 1e-9);
  }
  // Where three quarters of the rays are wild a start finds what pairs do not.
  const Bundle many(32, 8);
  const std::vector<PixelRay> mostly_wild = many.Rays(0.0, 24, 8);
  const auto point = EstimateRayPoint(PointersTo(mostly_wild), 0.01, many.point);
  ASSERT_TRUE(point);
  EXPECT_LT((*point - many.point).norm(), 1e-4);
}

TEST(EstimateRayPoint, NothingComesOfRaysThatSayNothing) {
  const Bundle bundle(2, 9);
  std::vector<PixelRay> rays = bundle.Rays(0.0, 0, 0);
  EXPECT_FALSE(EstimateRayPoint({}, 2.0));
  EXPECT_FALSE(EstimateRayPoint(Pointers{&rays[0]}, 2.0));
  // Rays that part meet behind the cameras only.
  PixelRay left = MakePixelRay(bundle.camera, {}, {220.0, 240.0}).value();
  PixelRay right = MakePixelRay(bundle.camera, {}, {420.0, 240.0}).value();
  right.centre.x() = 1.0;
  EXPECT_FALSE(EstimateRayPoint(Pointers{&left, &right}, 2.0));
}

TEST(EstimateRayPoint, NearlyParallelRaysGiveNothingOrSomethingFinite) {
  const Camera camera = MakePinhole(640, 480, 500.0, 500.0);
  for (const double baseline : {0.0, 1e-300, 1e-16, 1e-12, 1e-8, 1e-4}) {
    for (const double parallax_px : {0.0, 1e-13, 1e-9, 1e-5, -1e-5}) {
      std::vector<PixelRay> rays;
      for (int i = 0; i < 3; ++i) {
        Rigid3d cam_from_world;
        cam_from_world.translation.x() = -baseline * i;
        rays.push_back(
            MakePixelRay(camera, cam_from_world, {300.0 - parallax_px * i, 200.0}).value());
      }
      const auto point = EstimateRayPoint(PointersTo(rays), 2.0);
      EXPECT_TRUE(!point || point->allFinite()) << baseline << ' ' << parallax_px;
    }
  }
}

}  // namespace
}  // namespace vgtw
