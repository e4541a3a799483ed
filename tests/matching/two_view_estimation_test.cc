// SPDX-License-Identifier: BSD-3-Clause
#include "matching/two_view_estimation.h"

#include "scene/random.h"
#include "tests/matching/relative_pose_bound.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include <Eigen/LU>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

namespace vgtw {
namespace {

constexpr double kFocalLength = 700.0;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Matches i-i of two views; those in front are right.
struct TwoViews {
  Rigid3d cam2_from_cam1;
  ViewFeatures view1, view2;
  FeatureMatches matches;
  size_t num_right = 0;
};

void AddFeature(const Eigen::Vector2d& pixel, ViewFeatures& view) {
  view.pixels.push_back(pixel.cast<float>());
  view.rays.push_back(Unproject(view.view.camera, pixel)->cast<float>());
  view.scales.push_back(1.0f);
  view.depths.push_back(kNaN);
  view.depth_confs.push_back(0.0f);
}

bool IsInImage(const Eigen::Vector2d& pixel) {
  return (pixel.array() > 0.0).all() && pixel.x() < 800.0 && pixel.y() < 600.0;
}

struct Sampling {
  size_t num_right = 200;
  size_t num_wrong = 0;
  double noise_px = 0.5;
  double claimed_focal_length = kFocalLength;  // of both cameras
  uint64_t seed = 1;
};

// `depth_of` a ray of camera 1.
TwoViews MakeTwoViews(const Rigid3d& cam2_from_cam1,
                      const std::function<double(const Eigen::Vector3d&, RandomStream&)>& depth_of,
                      const Sampling& sampling) {
  RandomStream random(sampling.seed);
  const Camera true_camera = MakePinhole(800, 600, kFocalLength, kFocalLength);
  TwoViews views;
  views.cam2_from_cam1 = cam2_from_cam1;
  for (ViewFeatures* view : {&views.view1, &views.view2}) {
    view->view.camera =
        MakePinhole(800, 600, sampling.claimed_focal_length, sampling.claimed_focal_length);
  }
  const auto random_pixel = [&] {
    const double x = random.Uniform(0.0, 800.0);
    return Eigen::Vector2d(x, random.Uniform(0.0, 600.0));
  };
  while (views.view1.size() < sampling.num_right) {
    const Eigen::Vector2d pixel1 = random_pixel();
    const Eigen::Vector3d ray = Unproject(true_camera, pixel1)->homogeneous();
    const auto pixel2 = Project(true_camera, cam2_from_cam1 * (depth_of(ray, random) * ray));
    if (!pixel2 || !IsInImage(*pixel2)) continue;
    AddFeature(pixel1 + sampling.noise_px * random.NormalVector().head<2>(), views.view1);
    AddFeature(*pixel2 + sampling.noise_px * random.NormalVector().head<2>(), views.view2);
  }
  for (size_t i = 0; i < sampling.num_wrong; ++i) {
    AddFeature(random_pixel(), views.view1);
    AddFeature(random_pixel(), views.view2);
  }
  views.num_right = sampling.num_right;
  for (uint32_t i = 0; i < views.view1.size(); ++i) views.matches.push_back({i, i});
  return views;
}

Rigid3d SamplePose() {
  return {RotationAboutAxis(Eigen::Vector3d(0.2, 1.0, -0.3).normalized(), 9.0),
          Eigen::Vector3d(-0.9, 0.1, 0.25)};
}

double AnyDepth(const Eigen::Vector3d&, RandomStream& random) { return random.Uniform(3.0, 9.0); }

// A wall that stands askew: n . X = 5.
double DepthOfWall(const Eigen::Vector3d& ray, RandomStream&) {
  return 5.0 / ray.dot(Eigen::Vector3d(0.4, 0.2, 1.0));
}

// What noise makes of the pose at best, see relative_pose_bound.h.
PoseSigma LeastSigmaOf(const TwoViews& views, double noise_px) {
  std::vector<RayPair> pairs;
  for (size_t i = 0; i < views.num_right; ++i) {
    pairs.push_back({views.view1.rays[i].cast<double>(), views.view2.rays[i].cast<double>()});
  }
  Rigid3d pose = views.cam2_from_cam1;
  pose.translation.normalize();
  return LeastPoseSigma(pairs, pose, noise_px / kFocalLength);
}

double DirectionDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

TwoViewGeometry Estimate(const TwoViews& views, const TwoViewOptions& options = {}) {
  return EstimateTwoViewGeometry(views.view1, views.view2, views.matches, options);
}

size_t NumRight(const TwoViews& views, const FeatureMatches& inliers) {
  return static_cast<size_t>(std::count_if(inliers.begin(), inliers.end(), [&](const auto& match) {
    return match[0] < views.num_right;
  }));
}

void ExpectEqual(const TwoViewGeometry& a, const TwoViewGeometry& b) {
  EXPECT_EQ(a.config, b.config);
  EXPECT_EQ(a.inlier_matches, b.inlier_matches);
  EXPECT_EQ(a.E, b.E);
  EXPECT_EQ(a.F, b.F);
  EXPECT_EQ(a.H, b.H);
  ASSERT_EQ(a.cam2_from_cam1.has_value(), b.cam2_from_cam1.has_value());
  if (a.cam2_from_cam1) {
    EXPECT_EQ(a.cam2_from_cam1->ToMatrix(), b.cam2_from_cam1->ToMatrix());
  }
}

TEST(EstimateTwoViewGeometry, MeasuresThePoseOfAGeneralScene) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const TwoViews views = MakeTwoViews(SamplePose(), AnyDepth, {.seed = seed});
    const TwoViewGeometry geometry = Estimate(views);
    EXPECT_EQ(geometry.config, 2);
    // Noise of 0.5 px against 4 px: all but none are inliers.
    EXPECT_GE(geometry.inlier_matches.size(), 199u);
    ASSERT_TRUE(geometry.cam2_from_cam1);
    // Within three sigmas of the best that noise allows.
    const PoseSigma least = LeastSigmaOf(views, 0.5);
    EXPECT_LT(AngleBetweenDeg(geometry.cam2_from_cam1->rotation, SamplePose().rotation),
              3.0 * least.rotation_deg);
    EXPECT_LT(DirectionDeg(geometry.cam2_from_cam1->translation, SamplePose().translation),
              3.0 * least.direction_deg);
    EXPECT_NEAR(geometry.cam2_from_cam1->translation.norm(), 1.0, 1e-9);
  }
}

TEST(EstimateTwoViewGeometry, HalfOfTheMatchesMayBeWrong) {
  for (uint64_t seed = 0; seed < 3; ++seed) {
    const TwoViews views = MakeTwoViews(
        SamplePose(), AnyDepth, {.num_right = 200, .num_wrong = 200, .seed = 10 + seed});
    const TwoViewGeometry geometry = Estimate(views);
    EXPECT_EQ(geometry.config, 2);
    const size_t num_right = NumRight(views, geometry.inlier_matches);
    EXPECT_GE(num_right, 196u);
    // A wrong one is within 4 px of its line by chance: a band of 8 sqrt(2) px, one in fifty of an
    // image of 600 px. Of 200 that is 4; three times that.
    EXPECT_LE(geometry.inlier_matches.size() - num_right, 12u);
    const PoseSigma least = LeastSigmaOf(views, 0.5);
    EXPECT_LT(AngleBetweenDeg(geometry.cam2_from_cam1->rotation, SamplePose().rotation),
              3.0 * least.rotation_deg);
    EXPECT_LT(DirectionDeg(geometry.cam2_from_cam1->translation, SamplePose().translation),
              3.0 * least.direction_deg);
    EXPECT_TRUE(std::is_sorted(geometry.inlier_matches.begin(), geometry.inlier_matches.end()));
  }
}

// The conventions of scene/features.h: rays and E, pixels and F, in this order.
TEST(EstimateTwoViewGeometry, MatricesHoldForTheInliers) {
  const TwoViews views = MakeTwoViews(SamplePose(), AnyDepth, {.noise_px = 0.01, .seed = 20});
  const TwoViewGeometry geometry = Estimate(views);
  ASSERT_TRUE(geometry.E && geometry.F);
  for (const auto& [idx1, idx2] : geometry.inlier_matches) {
    const Eigen::Vector3d ray1 = views.view1.rays[idx1].cast<double>().homogeneous();
    const Eigen::Vector3d ray2 = views.view2.rays[idx2].cast<double>().homogeneous();
    const Eigen::Vector3d ray_line = *geometry.E * ray1;
    // A few times the noise, as everything is in the image.
    EXPECT_LT(std::abs(ray2.dot(ray_line)) / ray_line.head<2>().norm() * kFocalLength, 0.1);
    const Eigen::Vector3d x1 = views.view1.pixels[idx1].cast<double>().homogeneous();
    const Eigen::Vector3d x2 = views.view2.pixels[idx2].cast<double>().homogeneous();
    const Eigen::Vector3d pixel_line = *geometry.F * x1;
    EXPECT_LT(std::abs(x2.dot(pixel_line)) / pixel_line.head<2>().norm(), 0.3);
  }
  EXPECT_NEAR(geometry.F->determinant() / std::pow(geometry.F->norm(), 3), 0.0, 1e-9);
}

// Focal lengths of 700 taken for 1,800: no essential matrix fits, a fundamental one does.
TEST(EstimateTwoViewGeometry, WrongIntrinsicsAreUncalibrated) {
  const TwoViews views = MakeTwoViews(
      {RotationAboutAxis(Eigen::Vector3d(0.2, 1.0, -0.3).normalized(), 25.0), {-3.0, 0.3, 1.5}},
      AnyDepth,
      {.num_right = 300, .claimed_focal_length = 1800.0, .seed = 30});
  TwoViewOptions options;
  options.max_error_px = 2.0;
  const TwoViewGeometry geometry = Estimate(views, options);
  EXPECT_EQ(geometry.config, 3);
  EXPECT_FALSE(geometry.cam2_from_cam1);
  ASSERT_TRUE(geometry.F);
  EXPECT_GE(geometry.inlier_matches.size(), 285u);
}

TEST(EstimateTwoViewGeometry, AWallIsPlanar) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const TwoViews views = MakeTwoViews(SamplePose(), DepthOfWall, {.seed = 40 + seed});
    const TwoViewGeometry geometry = Estimate(views);
    EXPECT_EQ(geometry.config, 4);
    ASSERT_TRUE(geometry.H);
    EXPECT_GE(geometry.inlier_matches.size(), 199u);
    for (const auto& [idx1, idx2] : geometry.inlier_matches) {
      const Eigen::Vector3d x2 =
          *geometry.H * views.view1.pixels[idx1].cast<double>().homogeneous();
      EXPECT_LT((x2.hnormalized() - views.view2.pixels[idx2].cast<double>()).norm(), 4.0);
    }
    if (geometry.cam2_from_cam1) {
      EXPECT_NEAR(geometry.cam2_from_cam1->translation.norm(), 1.0, 1e-9);
    }
  }
}

TEST(EstimateTwoViewGeometry, TurningOnTheSpotIsPanoramic) {
  const Rigid3d turn = {RotationAboutAxis(Eigen::Vector3d(0.1, 1.0, 0.2).normalized(), 15.0),
                        Eigen::Vector3d::Zero()};
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const TwoViews views = MakeTwoViews(turn, AnyDepth, {.num_wrong = 50, .seed = 50 + seed});
    const TwoViewGeometry geometry = Estimate(views);
    EXPECT_EQ(geometry.config, 5);
    ASSERT_TRUE(geometry.cam2_from_cam1);
    EXPECT_EQ(geometry.cam2_from_cam1->translation, Eigen::Vector3d(0, 0, 0));
    // 0.5 px are 0.04 deg, averaged over 200; wrong inliers are within 4 px of right ones.
    EXPECT_LT(AngleBetweenDeg(geometry.cam2_from_cam1->rotation, turn.rotation), 0.03);
    EXPECT_GE(NumRight(views, geometry.inlier_matches), 198u);
  }
}

// Up to as many as chance leaves without 15 on one epipolar geometry.
TEST(EstimateTwoViewGeometry, RandomMatchesAreDegenerate) {
  for (const size_t count : {15u, 30u, 60u}) {
    const TwoViews views =
        MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 0, .num_wrong = count, .seed = 60});
    const TwoViewGeometry geometry = Estimate(views);
    EXPECT_EQ(geometry.config, 1) << count << " " << geometry.inlier_matches.size();
    EXPECT_TRUE(geometry.inlier_matches.empty());
    EXPECT_FALSE(geometry.E || geometry.F || geometry.H || geometry.cam2_from_cam1);
  }
}

TEST(EstimateTwoViewGeometry, TooFewMatchesAreDegenerate) {
  TwoViews views = MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 16});
  EXPECT_EQ(Estimate(views).config, 2);
  views.matches.resize(14);
  EXPECT_EQ(Estimate(views).config, 1);
  views.matches.clear();
  const TwoViewGeometry geometry = Estimate(views);
  EXPECT_EQ(geometry.config, 1);
  EXPECT_TRUE(geometry.inlier_matches.empty());
  EXPECT_EQ(EstimateTwoViewGeometry(views.view1, views.view2, {}, {}).config, 1);
}

TEST(EstimateTwoViewGeometry, WithoutRayNoInlier) {
  TwoViews views = MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 100});
  for (size_t i = 0; i < 100; i += 3) views.view1.rays[i] = {kNaN, kNaN};
  views.view2.rays[1] = {0.1f, kNaN};
  views.view2.rays[2] = {std::numeric_limits<float>::infinity(), 0.0f};
  const TwoViewGeometry geometry = Estimate(views);
  EXPECT_EQ(geometry.config, 2);
  EXPECT_EQ(geometry.inlier_matches.size(), 64u);
  for (const auto& match : geometry.inlier_matches) {
    EXPECT_TRUE(match[0] % 3 != 0 && match[0] > 2);
  }
  for (Eigen::Vector2f& ray : views.view1.rays) ray = {kNaN, kNaN};
  EXPECT_EQ(Estimate(views).config, 1);
}

// Nothing remains of what OpenCV did before, nor of the number of its threads.
TEST(EstimateTwoViewGeometry, SameInputSameOutput) {
  const TwoViews views =
      MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 100, .num_wrong = 60, .seed = 70});
  const TwoViewGeometry first = Estimate(views);
  ExpectEqual(Estimate(views), first);
  Estimate(MakeTwoViews(SamplePose(), DepthOfWall, {.num_wrong = 50, .seed = 71}));
  cv::theRNG().state = 12345;
  const int num_threads = cv::getNumThreads();
  cv::setNumThreads(1);
  ExpectEqual(Estimate(views), first);
  cv::setNumThreads(num_threads);
}

// Nothing to estimate from: no answer is right, but none crashes or is not finite.
TEST(EstimateTwoViewGeometry, DegenerateInputDoesNoHarm) {
  TwoViews same = MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 60});
  for (ViewFeatures* view : {&same.view1, &same.view2}) {
    std::fill(view->pixels.begin(), view->pixels.end(), Eigen::Vector2f(300.0f, 200.0f));
    std::fill(view->rays.begin(), view->rays.end(), Eigen::Vector2f(-0.1f, -0.1f));
  }
  TwoViews line = MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 60});
  for (ViewFeatures* view : {&line.view1, &line.view2}) {
    for (size_t i = 0; i < 60; ++i) {
      view->pixels[i] = {10.0f * static_cast<float>(i), 300.0f};
      view->rays[i] = (view->pixels[i] - Eigen::Vector2f(400.0f, 300.0f)) / 700.0f;
    }
  }
  // The same photo twice.
  TwoViews twice = MakeTwoViews({}, AnyDepth, {.num_right = 60, .noise_px = 0.0});
  for (const TwoViews* views : {&same, &line, &twice}) {
    const TwoViewGeometry geometry = Estimate(*views);
    if (geometry.cam2_from_cam1) {
      EXPECT_EQ(FindFault(*geometry.cam2_from_cam1), "");
    }
    for (const auto& matrix : {geometry.E, geometry.F, geometry.H}) {
      EXPECT_TRUE(!matrix || matrix->allFinite());
    }
    EXPECT_EQ(geometry.config == 1, geometry.inlier_matches.empty());
  }
  EXPECT_EQ(Estimate(twice).config, 5);
}

TEST(EstimateTwoViewGeometry, RefusesMatchesOfOtherViews) {
  TwoViews views = MakeTwoViews(SamplePose(), AnyDepth, {.num_right = 20});
  views.matches[7] = {20, 3};
  EXPECT_THROW(Estimate(views), std::invalid_argument);
  views.matches[7] = {3, 20};
  EXPECT_THROW(Estimate(views), std::invalid_argument);
}

TEST(TwoViewOptions, RefusesNonsense) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const TwoViewOptions& options : {TwoViewOptions{.max_error_px = 0.0},
                                        TwoViewOptions{.max_error_px = nan},
                                        TwoViewOptions{.min_num_inliers = 4},
                                        TwoViewOptions{.min_E_F_inlier_ratio = 1.1},
                                        TwoViewOptions{.max_H_inlier_ratio = -0.1},
                                        TwoViewOptions{.max_num_iterations = 0}}) {
    EXPECT_THROW(options.Check(), std::invalid_argument);
  }
}

}  // namespace
}  // namespace vgtw
