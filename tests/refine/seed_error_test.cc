// SPDX-License-Identifier: BSD-3-Clause
#include "refine/seed_error.h"

#include "scene/reprojection.h"
#include "scene/statistics.h"
#include "tests/support/synthetic_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

// How far the truth's points project from their pixels under the poses of `model`.
double TrueErrorPx(const Reconstruction& truth, Reconstruction model) {
  model.points3D = truth.points3D;
  return ComputeReprojectionStats(model).median_px;
}

// A share of all keypoints goes to random places.
void ScatterKeypoints(double share, unsigned seed, Reconstruction& model) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (auto& [id, image] : model.images) {
    for (Point2D& point2D : image.points2D) {
      if (uniform(random) >= share) continue;
      const double x = 640.0 * uniform(random);
      point2D.xy = {x, 480.0 * uniform(random)};
    }
  }
}

TEST(MeasureSeedError, IsTheNoiseAtTheTruth) {
  Reconstruction model = MakeSyntheticModel({});
  const SeedError exact = MeasureSeedError(model, TracksOf(model), 1);
  EXPECT_LT(exact.median_px, 1e-6);
  EXPECT_EQ(exact.max_px, 1.0);
  ProjectAgain(model, 0.5, 1);
  const SeedError noisy = MeasureSeedError(model, TracksOf(model), 1);
  // sqrt(2 log 2) sigma, of which a point takes 3 of 12 coordinates, is 0.51 px for least squares.
  // The robust point lies nearer to the half that it believes.
  EXPECT_LT(noisy.median_px, 0.51);
  EXPECT_GT(noisy.median_px, 0.4);
  EXPECT_NEAR(noisy.max_px, 6.0 * noisy.median_px, 1e-9);
}

TEST(MeasureSeedError, IsWhatThePosesAreOff) {
  for (unsigned seed = 0; seed < 2; ++seed) {
    SyntheticModelOptions options;
    options.num_images = 10;
    options.num_points = 300;
    options.seed = seed;
    const Reconstruction truth = MakeSyntheticModel(options);
    for (const double rotation_deg : {0.1, 0.5, 2.0, 5.0}) {
      Reconstruction model = truth;
      PerturbPoses(model, rotation_deg, 0.01 * rotation_deg, seed);
      const double true_px = TrueErrorPx(truth, model);
      const SeedError error = MeasureSeedError(model, TracksOf(model), 1);
      // A part of the errors is common to all views or moves points, hence cannot be seen.
      EXPECT_GT(error.median_px, 0.5 * true_px) << rotation_deg;
      EXPECT_LT(error.median_px, 1.2 * true_px) << rotation_deg;
    }
  }
}

TEST(MeasureSeedError, LimitIsAboveRightObservations) {
  for (const double rotation_deg : {0.1, 1.0, 4.0}) {
    SyntheticModelOptions options;
    options.num_images = 10;
    options.num_points = 300;
    Reconstruction model = MakeSyntheticModel(options);
    PerturbPoses(model, rotation_deg, 0.01 * rotation_deg, 2);
    const std::vector<Track> tracks = TracksOf(model);
    const SeedError error = MeasureSeedError(model, tracks, 1);
    TriangulationOptions triangulation;
    triangulation.max_error_px = error.max_px;
    const TriangulationSummary summary = TriangulateTracks(triangulation, tracks, model);
    // Views' angles are normal, so that some view in 10 may be off by three medians.
    EXPECT_GT(summary.num_observations, 2850u) << rotation_deg;
  }
}

TEST(MeasureSeedError, WrongMatchesHardlyCount) {
  for (const double rotation_deg : {0.0, 0.5, 2.0}) {
    SyntheticModelOptions options;
    options.num_images = 8;
    options.num_points = 300;
    Reconstruction model = MakeSyntheticModel(options);
    ProjectAgain(model, 0.5, 3);
    PerturbPoses(model, rotation_deg, 0.01 * rotation_deg, 3);
    const double before_px = MeasureSeedError(model, TracksOf(model), 1).median_px;
    ScatterKeypoints(0.2, 3, model);
    const double after_px = MeasureSeedError(model, TracksOf(model), 1).median_px;
    // The middle of all is the 62nd percentile of the right ones: 1.18 times their median if
    // errors are normal in two dimensions.
    EXPECT_GT(after_px, 0.9 * before_px) << rotation_deg;
    EXPECT_LT(after_px, 1.5 * before_px) << rotation_deg;
  }
}

TEST(MeasureSeedError, LongTracksSpeakFirst) {
  SyntheticModelOptions options;
  options.num_images = 3;
  options.num_points = 6000;
  Reconstruction model = MakeSyntheticModel(options);
  // 4000 exact tracks of three, after 2000 wrong ones of two.
  std::vector<Track> tracks = TracksOf(model);
  for (size_t i = 0; i < 2000; ++i) {
    tracks[i].pop_back();
    model.images.at(2).points2D[tracks[i][1].point2D_idx].xy.y() += 50.0;
  }
  EXPECT_LT(MeasureSeedError(model, tracks, 1).median_px, 1e-6);
}

TEST(MeasureSeedError, PairsDoNotHideTheErrorThatLongTracksShow) {
  SyntheticModelOptions options;
  options.num_images = 10;
  options.num_points = 1000;
  const Reconstruction truth = MakeSyntheticModel(options);
  Reconstruction model = truth;
  PerturbPoses(model, 1.0, 0.01, 5);
  std::vector<Track> tracks = TracksOf(model);
  for (size_t i = 0; i + 40 < tracks.size(); ++i) tracks[i].resize(2);
  const double true_px = TrueErrorPx(truth, model);
  EXPECT_GT(MeasureSeedError(model, tracks, 1).median_px, 0.5 * true_px);
  EXPECT_LT(MeasureSeedError(model, tracks, 1).median_px, 1.2 * true_px);
  // Of pairs alone the part along the epipolar line cannot be seen.
  tracks.resize(tracks.size() - 40);
  EXPECT_LT(MeasureSeedError(model, tracks, 1).median_px, 0.5 * true_px);
}

TEST(MeasureSeedError, IsBoundedAndIndependentOfThreads) {
  Reconstruction model = MakeSyntheticModel({});
  PerturbPoses(model, 60.0, 3.0, 4);
  const std::vector<Track> tracks = TracksOf(model);
  const SeedError error = MeasureSeedError(model, tracks, 1);
  const double worst_px = 497.5 * std::tan(15.0 * std::numbers::pi / 180.0);
  EXPECT_NEAR(error.max_px, worst_px, 1e-9);
  EXPECT_LE(error.median_px, 2.0 * worst_px);
  EXPECT_EQ(MeasureSeedError(model, tracks, 3).median_px, error.median_px);
  // Nothing is known without tracks, so that anything is allowed.
  EXPECT_NEAR(MeasureSeedError(model, {}, 1).max_px, worst_px, 1e-9);
  EXPECT_EQ(MeasureSeedError({}, {}, 1).max_px, 0.0);
}

}  // namespace
}  // namespace vgtw
