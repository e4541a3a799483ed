// SPDX-License-Identifier: BSD-3-Clause
#include "matching/match_pair.h"

#include "matching/sift.h"
#include "scene/random.h"
#include "scene/static_view.h"
#include "scene/synthetic.h"
#include "tests/matching/relative_pose_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

GrayImage Gray(const RgbImage& image) {
  GrayImage gray(image.width(), image.height());
  for (size_t i = 0; i < gray.size(); ++i) gray.data()[i] = image.data()[i][1];
  return gray;
}

// Two views of a synthetic room without movers, with true depths and their features. Made once a
// process, and each test is one: seconds count.
class Room {
 public:
  static const Room& Get() {
    static const Room room;
    return room;
  }

  const View& view(size_t idx) const { return scene_.views()[idx]; }

  // Features of view idx whose pose is turned by `rotation_deg` about its y axis.
  ViewFeatures Features(size_t idx, double rotation_deg, bool has_depth = true) const {
    ViewPrediction prediction = truth_.views[idx];
    Rigid3d& pose = prediction.view.cam_from_world;
    const Rigid3d turn = {RotationAboutAxis(Eigen::Vector3d::UnitY(), rotation_deg),
                          Eigen::Vector3d::Zero()};
    pose = turn * pose;
    const StaticView static_view(prediction, 0.5);
    return MakeViewFeatures(prediction.view, features_[idx], has_depth ? &static_view : nullptr);
  }

  // Pixels are within 3 of where the scene that one of them sees is in the other view: a feature on
  // a depth edge has two true places.
  bool IsRight(size_t idx1, size_t idx2, const std::array<uint32_t, 2>& match) const {
    const Eigen::Vector2d pixel1 = Pixel(idx1, match[0]);
    const Eigen::Vector2d pixel2 = Pixel(idx2, match[1]);
    return ErrorPx(idx1, pixel1, idx2, pixel2) <= 3.0 || ErrorPx(idx2, pixel2, idx1, pixel1) <= 3.0;
  }

  RayPair Rays(size_t idx1, size_t idx2, const std::array<uint32_t, 2>& match) const {
    return {*Unproject(view(idx1).camera, Pixel(idx1, match[0])),
            *Unproject(view(idx2).camera, Pixel(idx2, match[1]))};
  }

  Rigid3d TruePose(size_t idx1, size_t idx2) const {
    return view(idx2).cam_from_world * Inverse(view(idx1).cam_from_world);
  }

 private:
  Room()
      : scene_({.num_views = 2,
                .width = 480,
                .height = 360,
                .path_extent_deg = 20.0,
                .num_distractors = 0,
                .seed = 3}),
        truth_(MakeTruePrediction(scene_)) {
    for (size_t i = 0; i < 2; ++i) {
      features_.push_back(
          ExtractSift(Gray(scene_.Render(i).image), {}, {.max_num_features = 1200}));
    }
  }

  Eigen::Vector2d Pixel(size_t idx, uint32_t row) const {
    return {features_[idx].keypoints.x(row), features_[idx].keypoints.y(row)};
  }

  double ErrorPx(size_t from,
                 const Eigen::Vector2d& pixel,
                 size_t to,
                 const Eigen::Vector2d& matched) const {
    const auto point = scene_.StaticPoint(from, pixel);
    const auto seen =
        point ? Project(view(to).camera, view(to).cam_from_world * *point) : std::nullopt;
    return seen ? (*seen - matched).norm() : std::numeric_limits<double>::infinity();
  }

  SyntheticScene scene_;
  Prediction truth_;
  std::vector<vgtw::Features> features_;
};

double DirectionDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

size_t NumRight(size_t idx1, size_t idx2, const MatchedPair& pair) {
  size_t num_right = 0;
  for (const auto& match : pair.geometry.inlier_matches) {
    num_right += Room::Get().IsRight(idx1, idx2, match);
  }
  return num_right;
}

// About what keypoints of rendered photos are off by, root mean square per coordinate.
constexpr double kKeypointErrorPx = 0.5;

// What a measured pose may be wrong by: three times what that allows at best.
PoseSigma Tolerance(size_t idx1, size_t idx2, const MatchedPair& pair) {
  std::vector<RayPair> rays;
  for (const auto& match : pair.geometry.inlier_matches) {
    rays.push_back(Room::Get().Rays(idx1, idx2, match));
  }
  Rigid3d truth = Room::Get().TruePose(idx1, idx2);
  truth.translation.normalize();
  const double focal_length = Room::Get().view(idx1).camera.MeanFocalLength();
  const PoseSigma least = LeastPoseSigma(rays, truth, kKeypointErrorPx / focal_length);
  return {3.0 * least.rotation_deg, 3.0 * least.direction_deg};
}

void ExpectTruth(size_t idx1, size_t idx2, const MatchedPair& pair, double min_share_right) {
  const auto num_inliers = static_cast<double>(pair.geometry.inlier_matches.size());
  EXPECT_GE(num_inliers, 60.0);
  EXPECT_GE(static_cast<double>(NumRight(idx1, idx2, pair)), min_share_right * num_inliers);
  ASSERT_TRUE(pair.geometry.cam2_from_cam1);
  const Rigid3d truth = Room::Get().TruePose(idx1, idx2);
  const PoseSigma tolerance = Tolerance(idx1, idx2, pair);
  EXPECT_LT(tolerance.rotation_deg, 1.5);  // else it says nothing
  EXPECT_LT(AngleBetweenDeg(pair.geometry.cam2_from_cam1->rotation, truth.rotation),
            tolerance.rotation_deg);
  EXPECT_LT(DirectionDeg(pair.geometry.cam2_from_cam1->translation, truth.translation),
            tolerance.direction_deg);
}

// The wider the windows, the more is left to the epipolar line alone.
constexpr double kShareAtTruth = 0.99;
constexpr double kShareElsewhere = 0.98;

TEST(MatchPair, AtTheTruthFindsMoreThanPlainMatching) {
  for (const auto& [idx1, idx2] : {std::pair(0, 1), std::pair(1, 0)}) {
    const MatchingView view1(Room::Get().Features(idx1, 0.0));
    const MatchingView view2(Room::Get().Features(idx2, 0.0));
    const MatchedPair guided = MatchPair(view1, view2, {});
    const MatchedPair plain = MatchPairUnguided(view1, view2, {});
    EXPECT_EQ(guided.method, MatchMethod::kGuided);
    EXPECT_EQ(plain.method, MatchMethod::kUnguided);
    EXPECT_GE(NumRight(idx1, idx2, guided), NumRight(idx1, idx2, plain));
    ExpectTruth(idx1, idx2, guided, kShareAtTruth);
    ExpectTruth(idx1, idx2, plain, kShareElsewhere);
    EXPECT_EQ(guided.geometry.config, 2);
    ASSERT_TRUE(guided.prediction_error);
    const PoseSigma tolerance = Tolerance(idx1, idx2, guided);
    EXPECT_LT(guided.prediction_error->rotation_deg, tolerance.rotation_deg);
    EXPECT_LT(*guided.prediction_error->direction_deg, tolerance.direction_deg);
    EXPECT_GT(guided.window_radius_px, 0.0f);
    EXPECT_TRUE(std::includes(guided.matches.begin(),
                              guided.matches.end(),
                              guided.geometry.inlier_matches.begin(),
                              guided.geometry.inlier_matches.end()));
    for (size_t i = 1; i < guided.matches.size(); ++i) {
      EXPECT_LT(guided.matches[i - 1][0], guided.matches[i][0]);
    }
    // Whatever was matched in between, the same comes out.
    const MatchedPair again = MatchPair(view1, view2, {});
    EXPECT_EQ(guided.matches, again.matches);
    EXPECT_EQ(guided.geometry.inlier_matches, again.geometry.inlier_matches);
    EXPECT_EQ(guided.geometry.E, again.geometry.E);
    EXPECT_EQ(guided.window_radius_px, again.window_radius_px);
  }
}

// View 2 is predicted turned by so much. A few degrees cost nothing; what no window reaches is
// found by plain matching.
TEST(MatchPair, MeasuresHowWrongThePredictionIs) {
  const MatchingView view1(Room::Get().Features(0, 0.0));
  const size_t num_at_truth = MatchPair(view1, MatchingView(Room::Get().Features(1, 0.0)), {})
                                  .geometry.inlier_matches.size();
  for (const double turn_deg : {1.0, -3.0, 3.0, 60.0, 180.0}) {
    const MatchingView view2(Room::Get().Features(1, turn_deg));
    const MatchedPair pair = MatchPair(view1, view2, {});
    const bool is_near = std::abs(turn_deg) < 10.0;
    EXPECT_EQ(pair.method == MatchMethod::kUnguided, !is_near) << turn_deg;
    EXPECT_NE(pair.method, MatchMethod::kNone);
    EXPECT_GE(pair.geometry.inlier_matches.size(), num_at_truth * (is_near ? 9 : 5) / 10);
    ExpectTruth(0, 1, pair, kShareElsewhere);
    ASSERT_TRUE(pair.prediction_error && pair.prediction_error->direction_deg);
    // Up to what the measured pose itself may be wrong by. A turn of view 2 turns the direction by
    // as much at most.
    const PoseSigma tolerance = Tolerance(0, 1, pair);
    EXPECT_NEAR(pair.prediction_error->rotation_deg, std::abs(turn_deg), tolerance.rotation_deg);
    EXPECT_LT(*pair.prediction_error->direction_deg, std::abs(turn_deg) + tolerance.direction_deg);
  }
}

TEST(MatchPair, UsesWhatIsKnownAndNoMore) {
  const MatchingView truth1(Room::Get().Features(0, 0.0));
  const MatchingView truth2(Room::Get().Features(1, 0.0));
  const MatchedPair plain = MatchPairUnguided(truth1, truth2, {});
  // Poses alone.
  const MatchedPair by_poses = MatchPair(MatchingView(Room::Get().Features(0, 0.0, false)),
                                         MatchingView(Room::Get().Features(1, 0.0, false)),
                                         {});
  ExpectTruth(0, 1, by_poses, kShareElsewhere);
  EXPECT_GE(NumRight(0, 1, by_poses), NumRight(0, 1, plain) * 9 / 10);
  // Depth five times too large.
  ViewFeatures far = Room::Get().Features(0, 0.0);
  for (float& depth : far.depths) depth *= 5.0f;
  ExpectTruth(0, 1, MatchPair(MatchingView(far), truth2, {}), kShareElsewhere);
  // No pose at all, but the photos still match.
  ViewFeatures lost = Room::Get().Features(1, 0.0);
  lost.view.cam_from_world.translation.x() = std::numeric_limits<double>::quiet_NaN();
  const MatchedPair without_pose = MatchPair(truth1, MatchingView(lost), {});
  EXPECT_EQ(without_pose.method, MatchMethod::kUnguided);
  ExpectTruth(0, 1, without_pose, kShareElsewhere);
}

// Pixels and descriptors that have nothing in common.
ViewFeatures Noise(size_t count, uint64_t seed) {
  RandomStream random(seed);
  ViewFeatures features;
  features.view.camera = MakePinhole(480, 360, 400.0, 400.0);
  features.pixels.resize(count);
  features.rays.resize(count);
  features.scales.assign(count, 2.0f);
  features.depths.assign(count, 5.0f);
  features.depth_confs.assign(count, 1.0f);
  features.descriptors = {static_cast<uint32_t>(count), 128, 0, {}};
  for (size_t i = 0; i < count * 128; ++i) {
    features.descriptors.data.push_back(static_cast<uint8_t>(random.Bits() % 90));
  }
  for (size_t i = 0; i < count; ++i) {
    const double x = random.Uniform(0.0, 480.0);
    const Eigen::Vector2d pixel(x, random.Uniform(0.0, 360.0));
    features.pixels[i] = pixel.cast<float>();
    features.rays[i] = Unproject(features.view.camera, pixel)->cast<float>();
  }
  return features;
}

void ExpectNone(const MatchedPair& pair) {
  EXPECT_EQ(pair.method, MatchMethod::kNone);
  EXPECT_TRUE(pair.geometry.inlier_matches.empty());
  EXPECT_FALSE(pair.geometry.cam2_from_cam1 || pair.prediction_error);
}

TEST(MatchPair, UnrelatedPhotosHaveNoGeometry) {
  const MatchingView noise1(Noise(500, 1));
  const MatchingView noise2(Noise(500, 2));
  ExpectNone(MatchPair(noise1, noise2, {}));
  ExpectNone(MatchPairUnguided(noise1, noise2, {}));
}

TEST(MatchPair, EmptyViewsHaveNoGeometry) {
  const MatchingView empty(Noise(0, 1));
  const MatchingView one(Noise(1, 1));
  const MatchingView many(Noise(50, 2));
  for (const MatchingView* view : {&empty, &one}) {
    ExpectNone(MatchPair(*view, many, {}));
    ExpectNone(MatchPair(many, *view, {}));
    ExpectNone(MatchPair(*view, *view, {}));
    ExpectNone(MatchPairUnguided(*view, many, {}));
  }
}

TEST(MatchPair, WithoutRaysThereIsNoGeometry) {
  ViewFeatures features = Noise(50, 1);
  const MatchingView same(features);
  EXPECT_EQ(MatchPair(same, same, {}).geometry.config, 5);
  std::fill(features.rays.begin(), features.rays.end(), Eigen::Vector2f(kNaN, kNaN));
  ExpectNone(MatchPair(MatchingView(features), same, {}));
  ExpectNone(MatchPair(same, MatchingView(features), {}));
}

TEST(MatchPairOptions, RefusesNonsense) {
  MatchPairOptions options;
  EXPECT_NO_THROW(options.Check());
  options.num_sigmas = 0.0;
  EXPECT_THROW(options.Check(), std::invalid_argument);
  options = {};
  options.max_num_widenings = 17;
  EXPECT_THROW(options.Check(), std::invalid_argument);
  options = {};
  options.num_coarse_features = 0;
  EXPECT_THROW(options.Check(), std::invalid_argument);
  options = {};
  options.search.max_ratio = 2.0;
  EXPECT_THROW(options.Check(), std::invalid_argument);
  options = {};
  options.two_view.min_num_inliers = 0;
  EXPECT_THROW(options.Check(), std::invalid_argument);
  // As many as there are.
  options = {};
  options.num_coarse_features = std::numeric_limits<int>::max();
  options.two_view.min_num_inliers = std::numeric_limits<int>::max();
  ExpectNone(MatchPair(MatchingView(Noise(20, 3)), MatchingView(Noise(20, 4)), options));
}

TEST(MatchMethod, HasNames) {
  EXPECT_EQ(Name(MatchMethod::kNone), "none");
  EXPECT_EQ(Name(MatchMethod::kGuided), "guided");
  EXPECT_EQ(Name(MatchMethod::kWidened), "widened");
  EXPECT_EQ(Name(MatchMethod::kUnguided), "unguided");
}

}  // namespace
}  // namespace vgtw
