// SPDX-License-Identifier: BSD-3-Clause
#include "matching/search_window.h"

#include "scene/random.h"
#include "tests/support/wall_prediction.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr PredictionUncertainty kExact = {0.0, 0.0, 0.0, 0.0};
// What localisation costs, whatever the prediction.
constexpr double kMinRadiusPx = 3.0;

// Features at these pixels, all of one depth along z (NaN = unknown).
ViewFeatures FeaturesOf(const View& view, const std::vector<Eigen::Vector2d>& pixels, float depth) {
  Features features;
  features.keypoints = {static_cast<uint32_t>(pixels.size()), 2, {}};
  for (const Eigen::Vector2d& pixel : pixels) {
    features.keypoints.data.push_back(static_cast<float>(pixel.x()));
    features.keypoints.data.push_back(static_cast<float>(pixel.y()));
  }
  ViewFeatures result = MakeViewFeatures(view, std::move(features), nullptr);
  result.depths.assign(pixels.size(), depth);
  return result;
}

View WallView(double x) { return MakeWallView("a.png", x).view; }

bool Holds(const Capsule& capsule, const Eigen::Vector2d& pixel) {
  return capsule.SquaredDistanceToAxis(pixel.cast<float>()) <= capsule.radius * capsule.radius;
}

// Half a unit to the right is 6 pixels to the left; exact predictions leave a point.
TEST(WindowPredictor, IsAPointWhereNothingIsUncertain) {
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{44, 30}, {20.5, 7.25}}, 5.1f);
  const ViewFeatures view2 = FeaturesOf(WallView(0.5), {}, 5.1f);
  const WindowPredictor predictor(view1, view2, kExact, 2.0);
  for (size_t i = 0; i < 2; ++i) {
    const auto window = predictor.WindowOf(i);
    ASSERT_TRUE(window);
    const Eigen::Vector2f expected = view1.pixels[i] - Eigen::Vector2f(6.0f, 0.0f);
    // Rays are floats: 1e-7 of 61 pixels, and so are depths.
    EXPECT_LT((window->centre - expected).norm(), 2e-5f);
    EXPECT_LT((window->capsule.start - expected).norm(), 2e-5f);
    EXPECT_LT((window->capsule.end - expected).norm(), 2e-5f);
    EXPECT_NEAR(window->capsule.radius, kMinRadiusPx, 2e-5);
    EXPECT_NEAR(window->scale_ratio, 1.0f, 1e-6);
  }
}

TEST(WindowPredictor, FollowsTheFormulaByHand) {
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{44, 30}}, 5.1f);
  const ViewFeatures view2 = FeaturesOf(WallView(0.5), {}, 5.1f);
  const WindowPredictor predictor(view1, view2, {1.0, 0.1, 0.03, 0.06}, 2.0);
  const auto window = predictor.WindowOf(0);
  ASSERT_TRUE(window);
  // The step of 6 pixels goes as 1 / depth; the nearest comes first.
  EXPECT_NEAR(window->capsule.start.x(), 44.0 - 6.0 * std::exp(0.12), 1e-4);
  EXPECT_NEAR(window->capsule.end.x(), 44.0 - 6.0 * std::exp(-0.12), 1e-4);
  EXPECT_NEAR(window->capsule.start.y(), 30.0, 1e-4);
  EXPECT_NEAR(window->capsule.end.y(), 30.0, 1e-4);
  // p = (12, 6) and q = (6, 6) from the principal points; 61.2 / 5.1 = 12.
  const double rotation = 61.2 * std::numbers::pi / 180.0 * (1.0 + 72.0 / (61.2 * 61.2));
  const double centre = 12.0 * 0.1;
  const double focal = 0.03 * (std::sqrt(72.0) + std::sqrt(180.0));
  EXPECT_NEAR(window->capsule.radius,
              2.0 * std::sqrt(rotation * rotation + centre * centre + focal * focal),
              1e-4);
}

TEST(WindowPredictor, WidensWithEachUncertainty) {
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{44, 30}}, 5.1f);
  const ViewFeatures view2 = FeaturesOf(WallView(0.5), {}, 5.1f);
  const auto radius = [&](const PredictionUncertainty& uncertainty, double num_sigmas) {
    return WindowPredictor(view1, view2, uncertainty, num_sigmas).WindowOf(0)->capsule.radius;
  };
  EXPECT_NEAR(radius({0.0, 1.0, 0.0, 0.0}, 1.0), 12.0, 1e-4);
  EXPECT_NEAR(radius({0.0, 1.0, 0.0, 0.0}, 2.5), 30.0, 1e-4);
  EXPECT_NEAR(radius({0.0, 0.1, 0.0, 0.0}, 1.0), kMinRadiusPx, 1e-4);
  EXPECT_NEAR(radius({0.0, 0.0, 0.5, 0.0}, 1.0), 0.5 * (std::sqrt(72.0) + std::sqrt(180.0)), 1e-4);
}

// 1.7 nearer and twice the focal length: 5.1 / 3.4 * 2.
TEST(WindowPredictor, ScaleGrowsWithFocalLengthAndNearness) {
  View forward = WallView(0.0);
  forward.cam_from_world.translation.z() = -1.7;
  forward.camera.SetFocalLength(122.4, 122.4);
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{34, 26}}, 5.1f);
  const ViewFeatures view2 = FeaturesOf(forward, {}, kNaN);
  const auto window = WindowPredictor(view1, view2, kExact, 2.0).WindowOf(0);
  ASSERT_TRUE(window);
  EXPECT_NEAR(window->scale_ratio, 3.0f, 1e-5);
  EXPECT_LT((window->centre - Eigen::Vector2f(38.0f, 30.0f)).norm(), 1e-4f);
  const ViewFeatures unknown = FeaturesOf(WallView(0.0), {{34, 26}}, kNaN);
  EXPECT_EQ(WindowPredictor(unknown, view2, kExact, 2.0).WindowOf(0)->scale_ratio, 0.0f);
}

TEST(WindowPredictor, NothingIsSoughtWhereItCannotBeSeen) {
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{44, 30}}, 5.1f);
  const auto sees = [&](const View& view2) {
    const ViewFeatures features2 = FeaturesOf(view2, {}, 5.1f);
    return WindowPredictor(view1, features2, {}, 2.0).WindowOf(0).has_value();
  };
  EXPECT_TRUE(sees(WallView(0.5)));
  EXPECT_FALSE(sees(WallView(40.0)));  // 480 pixels beside the image
  View beyond = WallView(0.0);
  beyond.cam_from_world.translation.z() = -9.0;  // behind the wall
  EXPECT_FALSE(sees(beyond));
  View back = WallView(0.0);
  back.cam_from_world.rotation = RotationAboutAxis(Eigen::Vector3d::UnitY(), 180.0);
  EXPECT_FALSE(sees(back));
  View nowhere = WallView(0.5);
  nowhere.cam_from_world.translation.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(sees(nowhere));
}

TEST(WindowPredictor, ARimInTheImageCounts) {
  // The counterpart is 4 pixels left of the image: seen with a radius of 5, not of 3.
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{2, 30}}, 5.1f);
  const ViewFeatures view2 = FeaturesOf(WallView(0.5), {}, 5.1f);
  EXPECT_FALSE(WindowPredictor(view1, view2, kExact, 1.0).WindowOf(0));
  EXPECT_TRUE(WindowPredictor(view1, view2, {0.0, 5.0 / 12.0, 0.0, 0.0}, 1.0).WindowOf(0));
}

TEST(WindowPredictor, WithoutRayOrDepthOfUseThereIsNone) {
  ViewFeatures view1 = FeaturesOf(WallView(0.0), {{44, 30}, {44, 30}}, 5.1f);
  view1.rays[0] = {kNaN, kNaN};
  view1.depths[1] = -5.1f;
  const ViewFeatures view2 = FeaturesOf(WallView(0.5), {}, 5.1f);
  const WindowPredictor predictor(view1, view2, {}, 2.0);
  EXPECT_FALSE(predictor.WindowOf(0));
  EXPECT_FALSE(predictor.WindowOf(1));
}

// Of a depth range that reaches behind view 2 only what is in front of it counts.
TEST(WindowPredictor, CutsOffWhatIsBehind) {
  View close = WallView(0.0);
  close.cam_from_world.translation.z() = -5.0;  // 0.1 in front of the wall
  const ViewFeatures view1 = FeaturesOf(WallView(0.0), {{32.1, 24.1}}, 5.1f);
  const ViewFeatures view2 = FeaturesOf(close, {}, kNaN);
  const auto window = WindowPredictor(view1, view2, {0.0, 0.0, 0.0, 0.06}, 2.0).WindowOf(0);
  ASSERT_TRUE(window);
  const auto truth =
      Project(close.camera,
              close.cam_from_world * Eigen::Vector3d(5.1 * 0.1 / 61.2, 5.1 * 0.1 / 61.2, 5.1));
  EXPECT_TRUE(Holds(window->capsule, *truth));
}

// Two views of a camera of 1000 x 750 pixels, one step and a turn apart.
struct ViewPair {
  View view1, view2;
};

ViewPair MakeViewPair(double radial_distortion) {
  ViewPair pair;
  pair.view1.camera = MakePinhole(1000, 750, 900.0, 900.0);
  if (radial_distortion != 0.0) {
    pair.view1.camera.model = CameraModel::kSimpleRadial;
    pair.view1.camera.params = {900.0, 500.0, 375.0, radial_distortion};
  }
  pair.view2 = pair.view1;
  pair.view2.cam_from_world = {RotationAboutAxis(Eigen::Vector3d(0.3, 1.0, 0.2).normalized(), 8.0),
                               {-1.0, 0.2, -0.3}};
  return pair;
}

Eigen::Vector2d RandomPixel(RandomStream& random) {
  const double x = random.Uniform(0.0, 1000.0);
  return {x, random.Uniform(0.0, 750.0)};
}

bool IsIn(const Camera& camera, const Eigen::Vector2d& pixel) {
  return (pixel.array() >= 0.0).all() && pixel.x() < static_cast<double>(camera.width) &&
         pixel.y() < static_cast<double>(camera.height);
}

// The share of true counterparts that lie in their windows if everything is as wrong as stated.
double ShareInWindow(const PredictionUncertainty& uncertainty, double num_sigmas) {
  const ViewPair truth = MakeViewPair(0.0);
  RandomStream random(1);
  int num_seen = 0;
  int num_held = 0;
  while (num_seen < 3000) {
    const Eigen::Vector2d pixel1 = RandomPixel(random);
    const double depth = random.Uniform(4.0, 12.0);
    const Eigen::Vector3d point = depth * Unproject(truth.view1.camera, pixel1)->homogeneous();
    const auto pixel2 = Project(truth.view2.camera, truth.view2.cam_from_world * point);
    if (!pixel2 || !IsIn(truth.view2.camera, *pixel2)) continue;
    ++num_seen;
    ViewPair predicted = truth;
    for (View* view : {&predicted.view1, &predicted.view2}) {
      const double focal = 900.0 * (1.0 + uncertainty.focal * random.Normal());
      view->camera.SetFocalLength(focal, focal);
    }
    Rigid3d& pose = predicted.view2.cam_from_world;
    const Eigen::Vector3d turn =
        uncertainty.rotation_deg * std::numbers::pi / 180.0 * random.NormalVector();
    pose.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * pose.rotation;
    // The translation as the camera sees it: the step between the centres, wrong by its sigma.
    pose.translation = pose.rotation * (truth.view2.cam_from_world.rotation.conjugate() *
                                            truth.view2.cam_from_world.translation +
                                        uncertainty.centre * random.NormalVector());
    const auto predicted_depth =
        static_cast<float>(depth * std::exp(uncertainty.depth * random.Normal()));
    const ViewFeatures features1 = FeaturesOf(predicted.view1, {pixel1}, predicted_depth);
    const ViewFeatures features2 = FeaturesOf(predicted.view2, {}, kNaN);
    const auto window = WindowPredictor(features1, features2, uncertainty, num_sigmas).WindowOf(0);
    if (window && Holds(window->capsule, *pixel2)) ++num_held;
  }
  return num_held / 3000.0;
}

// Errors of each component are normal with these sigmas, and the image has two dimensions: a circle
// of k sigmas holds 1 - exp(-k^2 / 2) of them, 86.5 % for 2 and 98.9 % for 3. Windows hold more,
// because depth lengthens them. 3000 trials deviate by 0.6 and 0.2 %.
TEST(WindowPredictor, HoldsTheTruthAsOftenAsItsSigmasSay) {
  for (const PredictionUncertainty& uncertainty : {PredictionUncertainty{1.0, 0.1, 0.03, 0.06},
                                                   PredictionUncertainty{2.0, 0.01, 0.001, 0.2},
                                                   PredictionUncertainty{0.1, 0.3, 0.001, 0.02},
                                                   PredictionUncertainty{0.1, 0.01, 0.1, 0.02}}) {
    EXPECT_GT(ShareInWindow(uncertainty, 2.0), 0.845);
    EXPECT_GT(ShareInWindow(uncertainty, 3.0), 0.98);
    // And they are not as wide as that for fewer: a circle of half a sigma holds 12 %, one of a
    // sigma 39 %, and half the errors of a depth or a focal length, which have one dimension, are
    // within 0.67 sigmas.
    EXPECT_LT(ShareInWindow(uncertainty, 0.5), 0.6);
  }
}

// With exact poses the segment of an unknown depth is the epipolar one: every depth from half the
// baseline on lies in it, whatever the lens does to it.
void ExpectEveryDepthInWindow(double radial_distortion,
                              float known_depth,
                              double nearest,
                              double farthest) {
  const ViewPair views = MakeViewPair(radial_distortion);
  RandomStream random(2);
  const ViewFeatures view2 = FeaturesOf(views.view2, {}, kNaN);
  int num_seen = 0;
  while (num_seen < 2000) {
    const Eigen::Vector2d pixel1 = RandomPixel(random);
    const double depth = std::exp(random.Uniform(std::log(nearest), std::log(farthest)));
    const auto ray = Unproject(views.view1.camera, pixel1);
    ASSERT_TRUE(ray);
    const Eigen::Vector3d point2 = views.view2.cam_from_world * (depth * ray->homogeneous());
    const auto pixel2 = Project(views.view2.camera, point2);
    if (!pixel2 || !IsIn(views.view2.camera, *pixel2)) continue;
    ++num_seen;
    // The second feature tells in which depths the scene lies, if any.
    ViewFeatures view1 = FeaturesOf(views.view1, {pixel1, pixel1, pixel1}, kNaN);
    view1.depths[1] = known_depth;
    view1.depths[2] = 2.0f * known_depth;
    const auto window = WindowPredictor(view1, view2, kExact, 2.0).WindowOf(0);
    ASSERT_TRUE(window) << pixel1.transpose() << " depth " << depth;
    ASSERT_TRUE(Holds(window->capsule, *pixel2))
        << pixel1.transpose() << " depth " << depth << " at " << pixel2->transpose() << " window "
        << window->capsule.start.transpose() << " to " << window->capsule.end.transpose()
        << " radius " << window->capsule.radius;
  }
}

TEST(WindowPredictor, UnknownDepthGivesTheEpipolarSegment) {
  const double baseline = Eigen::Vector3d(-1.0, 0.2, -0.3).norm();
  ExpectEveryDepthInWindow(0.0, kNaN, 0.501 * baseline, 9999.0 * baseline);
}

TEST(WindowPredictor, KnownDepthsOfOthersBoundTheSegment) {
  // Percentiles 1 and 99 of 4 and 8.
  ExpectEveryDepthInWindow(0.0, 4.0f, 4.05, 7.95);
  const ViewPair views = MakeViewPair(0.0);
  ViewFeatures view1 = FeaturesOf(views.view1, {{500, 375}, {1, 1}, {2, 2}}, kNaN);
  view1.depths[1] = 4.0f;
  view1.depths[2] = 8.0f;
  const ViewFeatures view2 = FeaturesOf(views.view2, {}, kNaN);
  const auto window = WindowPredictor(view1, view2, kExact, 2.0).WindowOf(0);
  ASSERT_TRUE(window);
  for (const auto& [depth, end] :
       {std::pair(4.04, window->capsule.start), std::pair(7.96, window->capsule.end)}) {
    const auto pixel2 =
        Project(views.view2.camera, views.view2.cam_from_world * Eigen::Vector3d(0, 0, depth));
    EXPECT_LT((pixel2->cast<float>() - end).norm(), 1e-2f);
  }
}

// Bent by tens of pixels at the corners.
TEST(WindowPredictor, LensesBendTheSegment) {
  for (const double k : {-0.15, -0.05, 0.1}) {
    ExpectEveryDepthInWindow(k, kNaN, 1.0, 1000.0);
    ExpectEveryDepthInWindow(k, 3.0f, 3.1, 5.9);
  }
}

// A camera that turned on the spot sees all depths in one place.
TEST(WindowPredictor, NoBaselineNeedsNoDepth) {
  ViewPair views = MakeViewPair(0.0);
  views.view2.cam_from_world.translation.setZero();
  const ViewFeatures view1 = FeaturesOf(views.view1, {{500, 375}}, kNaN);
  const ViewFeatures view2 = FeaturesOf(views.view2, {}, kNaN);
  const auto window = WindowPredictor(view1, view2, kExact, 2.0).WindowOf(0);
  ASSERT_TRUE(window);
  const auto pixel2 =
      Project(views.view2.camera, views.view2.cam_from_world.rotation * Eigen::Vector3d::UnitZ());
  EXPECT_LT((pixel2->cast<float>() - window->centre).norm(), 1e-3f);
  EXPECT_NEAR(window->capsule.radius, kMinRadiusPx, 1e-3);
}

TEST(PredictionUncertainty, RefusesNonsense) {
  EXPECT_NO_THROW(PredictionUncertainty{}.Check());
  EXPECT_NO_THROW(kExact.Check());
  for (const double bad : {-0.1, 91.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW((PredictionUncertainty{bad, 0.0, 0.0, 0.0}.Check()), std::invalid_argument);
    EXPECT_THROW((PredictionUncertainty{0.0, 0.0, bad, 0.0}.Check()), std::invalid_argument);
    EXPECT_THROW((PredictionUncertainty{0.0, 0.0, 0.0, bad}.Check()), std::invalid_argument);
  }
  EXPECT_THROW((PredictionUncertainty{0.0, -1.0, 0.0, 0.0}.Check()), std::invalid_argument);
  EXPECT_THROW(
      (PredictionUncertainty{0.0, std::numeric_limits<double>::infinity(), 0.0, 0.0}.Check()),
      std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
