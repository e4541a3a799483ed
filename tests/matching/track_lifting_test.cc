// SPDX-License-Identifier: BSD-3-Clause
#include "matching/track_lifting.h"

#include "scene/perturb.h"
#include "scene/statistics.h"
#include "scene/synthetic.h"
#include "tests/matching/sample_tracks.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// Rays and depths are floats: 6e-8 of distances of about 5, in three coordinates.
constexpr double kFloatTolerance = 1e-6;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

RandomStream Random(uint64_t seed = 0) { return RandomStream(HashKey({seed, 29})); }

std::vector<double> Errors(const LiftedTracks& lifted, const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> errors;
  for (size_t i = 0; i < points.size(); ++i) {
    if (lifted.points[i]) errors.push_back((lifted.points[i]->xyz - points[i]).norm());
  }
  return errors;
}

double Largest(const std::vector<double>& values) { return Percentile(values, 100.0); }

TEST(LiftTracks, IsExactAtTheTruth) {
  for (const double forward : {0.0, 0.8}) {
    const TrackScene scene = MakeWallScene(3, forward);
    const LiftedTracks lifted = LiftTracks(scene.views, scene.tracks, {});
    EXPECT_EQ(lifted.num_lifted, 9u);
    EXPECT_EQ(lifted.ray_sigma_deg, LiftOptions().min_ray_sigma_deg);
    ASSERT_EQ(Errors(lifted, scene.points).size(), 9u);
    EXPECT_LT(Largest(Errors(lifted, scene.points)), kFloatTolerance);
    for (size_t i = 0; i < lifted.points.size(); ++i) {
      EXPECT_EQ(lifted.points[i]->track, scene.tracks[i]);
      EXPECT_LT(lifted.points[i]->error_deg, 1e-5);
    }
  }
}

TEST(LiftTracks, AppliesScales) {
  TrackScene scene = MakeWallScene(2);
  RandomStream random = Random();
  for (auto& [image_id, view] : scene.views) ScaleDepths(1.25, 0.0, random, view);
  // Rays that meet at 6 degrees, of unknown accuracy, do not contradict such depths.
  EXPECT_GT(Median(Errors(LiftTracks(scene.views, scene.tracks, {}), scene.points)), 0.1);
  const DepthScales scales = {{1, {.scale = 0.8}}, {2, {.scale = 0.8}}};
  const LiftedTracks lifted = LiftTracks(scene.views, scene.tracks, scales);
  ASSERT_EQ(lifted.num_lifted, 9u);
  EXPECT_LT(Largest(Errors(lifted, scene.points)), kFloatTolerance);
}

// Two views at one place, the second of depth 5 % too long: the mean of the two is 2.5 % too long,
// unless the second has less weight, be it by its spread or by confidences below its median.
TEST(LiftTracks, TrustsSpreadAndConfidence) {
  const auto error_with = [](double spread, float confidence) {
    TrackScene scene = MakeWallScene(1);
    AddView({}, 2, scene);
    RandomStream random = Random();
    ViewFeatures& view = scene.views.at(2);
    ScaleDepths(1.05, 0.0, random, view);
    std::fill(view.depth_confs.begin(), view.depth_confs.begin() + 4, confidence);
    const DepthScales scales = {{1, {.spread = 0.05}}, {2, {.spread = spread}}};
    const LiftedTracks lifted = LiftTracks(scene.views, scene.tracks, scales);
    return lifted.points[0]->xyz.z() / kWallDepth - 1.0;
  };
  // Means weighted by 1 / sigma^2 where sigma is 5 % of the depth; half a per cent for Tukey's
  // loss.
  EXPECT_NEAR(error_with(0.05, 1.0f), 0.025, 0.005);
  EXPECT_NEAR(error_with(0.15, 1.0f), 0.05 / (1.0 + 9.0 * 1.1), 0.005);
  EXPECT_NEAR(error_with(0.05, 0.25f), 0.05 / (1.0 + 4.0 * 1.1), 0.005);
}

TEST(LiftTracks, OneBadViewOfFiveDoesNotMovePoints) {
  for (ImageId bad = 1; bad <= 5; ++bad) {
    RandomStream random = Random(bad);
    TrackScene bad_depth = MakeArcScene(5, 200, 40.0, 3);
    for (float& depth : bad_depth.views.at(bad).depths) {
      depth = static_cast<float>(random.Uniform(1.0, 12.0));
    }
    TrackScene bad_pose = MakeArcScene(5, 200, 40.0, 3);
    MoveView(20.0, 0.5, random, bad_pose.views.at(bad));
    for (const TrackScene& scene : {bad_depth, bad_pose}) {
      const LiftedTracks lifted =
          LiftTracks(scene.views, scene.tracks, EstimateDepthScales(scene.views, scene.tracks));
      EXPECT_EQ(lifted.num_lifted, 200u);
      // The bad view moves scales by less than the noise floor of 0.2 %, rays hold most of that.
      EXPECT_LT(Median(Errors(lifted, scene.points)), 1e-4);
      // Where a wrong depth or ray happens to be nearly right, it takes part, but the rays, which
      // meet at up to 40 degrees, hold the point: 4 sigma of 0.02 deg at 4 are 0.006.
      EXPECT_LT(Largest(Errors(lifted, scene.points)), 0.01);
    }
  }
}

TEST(LiftTracks, UnknownStaysUnknown) {
  TrackScene scene = MakeWallScene(3);
  for (ImageId id = 1; id <= 3; ++id) scene.views.at(id).depths[0] = kNaN;  // none knows
  scene.views.at(1).depths[1] = kNaN;                                       // two know
  scene.views.at(2).rays[2] = {kNaN, kNaN};
  scene.tracks[3].push_back({77, 12345});  // of a view that was not predicted
  scene.tracks[4] = {{1, 4}, {77, 4}};
  scene.tracks[5] = {};
  scene.views.at(3).depths[6] = -1.0f;
  const LiftedTracks lifted = LiftTracks(scene.views, scene.tracks, {});
  EXPECT_FALSE(lifted.points[0] || lifted.points[4] || lifted.points[5]);
  EXPECT_EQ(lifted.num_lifted, 6u);
  EXPECT_EQ(lifted.points[1]->track.size(), 3u);
  EXPECT_EQ(lifted.points[2]->track, (std::vector<TrackElement>{{1, 2}, {3, 2}}));
  EXPECT_EQ(lifted.points[3]->track.size(), 3u);
  EXPECT_LT(Largest(Errors(lifted, scene.points)), kFloatTolerance);

  EXPECT_TRUE(LiftTracks(scene.views, {}, {}).points.empty());
  EXPECT_EQ(LiftTracks({}, scene.tracks, {}).num_lifted, 0u);
}

// Rotations of this sigma about random axes move rays by 1 / sqrt(3) of it per axis (rms). Their
// median is three quarters of that, for they are no normal distribution, and depth is free to
// follow part of it.
TEST(LiftTracks, MeasuresTheErrorOfRays) {
  for (const double sigma_deg : {0.1, 0.5}) {
    std::vector<double> measured;
    for (uint64_t seed = 0; seed < 4; ++seed) {
      TrackScene scene = MakeArcScene(10, 300, 60.0, seed);
      RandomStream random = Random(seed);
      for (auto& [image_id, view] : scene.views) {
        MoveView(sigma_deg, 0.0, random, view);
        ScaleDepths(1.0, 0.02, random, view);
      }
      const DepthScales scales = EstimateDepthScales(scene.views, scene.tracks);
      measured.push_back(LiftTracks(scene.views, scene.tracks, scales).ray_sigma_deg);
    }
    EXPECT_GT(Percentile(measured, 0.0), 0.4 * sigma_deg / std::sqrt(3.0));
    EXPECT_LT(Largest(measured), 1.4 * sigma_deg / std::sqrt(3.0));
  }
}

TEST(LiftTracks, ThreadsDoNotMatter) {
  TrackScene scene = MakeArcScene(4, 3000, 30.0, 5);
  RandomStream random = Random();
  for (auto& [image_id, view] : scene.views) ScaleDepths(1.0, 0.02, random, view);
  const LiftedTracks a = LiftTracks(scene.views, scene.tracks, {}, {.num_threads = 1});
  const LiftedTracks b = LiftTracks(scene.views, scene.tracks, {}, {.num_threads = 3});
  EXPECT_EQ(Errors(a, scene.points), Errors(b, scene.points));
}

TEST(LiftTracks, RefusesWhatCannotBe) {
  const TrackScene scene = MakeWallScene(2);
  EXPECT_THROW(LiftTracks(scene.views, {{{1, 9}, {2, 0}}}, {}), std::invalid_argument);
  EXPECT_THROW(LiftTracks({}, {}, {}, {.max_sigmas = 0.0}), std::invalid_argument);
  EXPECT_THROW(LiftTracks({}, {}, {}, {.min_ray_sigma_deg = 11.0}), std::invalid_argument);
  EXPECT_THROW(LiftTracks({}, {}, {}, {.max_error_deg = 90.0}), std::invalid_argument);
}

// Keypoints at true places of the static scene: a grid of pixels of every second view, and where
// the others see the same point.
struct SyntheticTracks {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<TrackElement>> tracks;
  std::vector<Keypoints> keypoints;  // by view
};

SyntheticTracks TrueTracks(const SyntheticScene& scene) {
  constexpr int kStepPx = 64;
  const std::vector<View>& views = scene.views();
  SyntheticTracks result;
  result.keypoints.assign(views.size(), {0, 2, {}});
  for (size_t i = 0; i < views.size(); i += 2) {
    for (int y = kStepPx / 2; y < scene.options().height; y += kStepPx) {
      for (int x = kStepPx / 2; x < scene.options().width; x += kStepPx) {
        const auto point = scene.StaticPoint(i, Eigen::Vector2d(x, y));
        if (!point) continue;
        std::vector<TrackElement> track;
        for (size_t k = 0; k < views.size(); ++k) {
          const auto pixel = Project(views[k].camera, views[k].cam_from_world * *point);
          if (!pixel) continue;
          const auto seen = scene.StaticPoint(k, *pixel);
          if (!seen || (*seen - *point).norm() > 1e-6) continue;
          Keypoints& keypoints = result.keypoints[k];
          track.push_back({static_cast<ImageId>(k + 1), keypoints.rows++});
          keypoints.data.push_back(static_cast<float>(pixel->x()));
          keypoints.data.push_back(static_cast<float>(pixel->y()));
        }
        result.points.push_back(*point);
        result.tracks.push_back(std::move(track));
      }
    }
  }
  return result;
}

std::map<ImageId, ViewFeatures> MakeViews(const Prediction& prediction,
                                          const SyntheticTracks& truth) {
  std::map<ImageId, ViewFeatures> views;
  for (size_t i = 0; i < prediction.views.size(); ++i) {
    const StaticView static_view(prediction.views[i], 0.5);
    views[static_cast<ImageId>(i + 1)] =
        MakeViewFeatures(prediction.views[i].view, {truth.keypoints[i], {}}, &static_view);
  }
  return views;
}

// Each track lifted from its first view alone.
std::vector<double> ErrorsOfSingleViews(const std::map<ImageId, ViewFeatures>& views,
                                        const SyntheticTracks& truth) {
  std::vector<double> errors;
  for (size_t i = 0; i < truth.tracks.size(); ++i) {
    const TrackElement& first = truth.tracks[i].front();
    const Eigen::Vector3d point = views.at(first.image_id).PointInWorld(first.point2D_idx);
    if (point.allFinite()) errors.push_back((point - truth.points[i]).norm());
  }
  return errors;
}

// Errors of a feed-forward network; centres are off by 0.155 (rms; 2 % of 7.76). Median errors of
// points: depth of one view 0.155, all views 0.129, with scales 0.116. Factors of 10 % instead of
// 1 %: 0.212, 0.148 and 0.189: their median over 12 views is off by some 4 %, which the scales
// leave in, while depth of unknown spread gives way to the rays.
TEST(LiftTracks, BeatsSingleViewsUnderTheErrorsOfNetworks) {
  const SyntheticScene scene({.num_threads = 1, .seed = 4});
  const SyntheticTracks truth = TrueTracks(scene);
  const Prediction exact = MakeTruePrediction(scene, 252);
  for (const double scale_percent : {1.0, 10.0}) {
    const Prediction noisy =
        Perturb(exact, {.depth_scale_percent = scale_percent, .random_world = false, .seed = 4});
    const auto views = MakeViews(noisy, truth);
    const DepthScales scales = EstimateDepthScales(views, truth.tracks);
    const LiftedTracks without = LiftTracks(views, truth.tracks, {});
    const LiftedTracks with = LiftTracks(views, truth.tracks, scales);
    EXPECT_GT(with.num_lifted, truth.tracks.size() * 9 / 10);
    EXPECT_GE(with.num_lifted, without.num_lifted);
    const double single_view = Median(ErrorsOfSingleViews(views, truth));
    EXPECT_LT(Median(Errors(with, truth.points)), 0.95 * single_view);
    if (scale_percent > 1.0) continue;
    EXPECT_LT(Median(Errors(with, truth.points)), 0.8 * single_view);
    EXPECT_LT(Median(Errors(with, truth.points)), 0.95 * Median(Errors(without, truth.points)));
  }
}

// A model of the wall views without points.
Reconstruction MakeModel(const TrackScene& scene) {
  Reconstruction model;
  for (const auto& [image_id, view] : scene.views) {
    Camera camera = view.view.camera;
    camera.camera_id = image_id;
    model.cameras[image_id] = camera;
    Image image;
    image.image_id = image_id;
    image.camera_id = image_id;
    image.cam_from_world = view.view.cam_from_world;
    for (const Eigen::Vector2f& pixel : view.pixels)
      image.points2D.push_back({pixel.cast<double>()});
    model.images[image_id] = image;
  }
  return model;
}

TEST(AddPoints, KeepsTheLawOfModels) {
  const TrackScene scene = MakeWallScene(3);
  const LiftedTracks lifted = LiftTracks(scene.views, scene.tracks, {});
  Reconstruction model = MakeModel(scene);
  EXPECT_EQ(AddPoints(lifted, model), 9u);
  EXPECT_EQ(FindFault(model), "");
  EXPECT_EQ(model.points3D.at(1).track, scene.tracks[0]);
  EXPECT_LT((model.points3D.at(9).xyz - scene.points[8]).norm(), kFloatTolerance);
  EXPECT_EQ(model.images.at(2).points2D[4].point3D_id, 5u);
  // Keypoints are floats: 4e-6 px of 64.
  EXPECT_GE(model.points3D.at(5).error, 0.0);
  EXPECT_LT(model.points3D.at(5).error, 1e-5);
  EXPECT_EQ(AddPoints(lifted, model), 0u) << "all are taken";
  EXPECT_EQ(FindFault(model), "");
}

TEST(AddPoints, LeavesOutWhatIsMissingOrTaken) {
  const TrackScene scene = MakeWallScene(3);
  const LiftedTracks lifted = LiftTracks(scene.views, scene.tracks, {});
  Reconstruction model = MakeModel(scene);
  model.images.erase(3);
  model.cameras.erase(3);
  model.images.at(1).points2D[0].point3D_id = 70;
  model.images.at(2).points2D[1].point3D_id = 70;
  model.points3D[70] = {.xyz = {0, 0, 5}, .track = {{1, 0}, {2, 1}}};
  EXPECT_EQ(AddPoints(lifted, model), 7u);
  EXPECT_EQ(FindFault(model), "");
  EXPECT_EQ(model.points3D.rbegin()->first, 77u);
  model.images.at(2).points2D.resize(3);
  EXPECT_THROW(AddPoints(lifted, model), std::invalid_argument);
}

}  // namespace
}  // namespace vgtw
