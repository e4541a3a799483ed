// SPDX-License-Identifier: BSD-3-Clause
// match_views_benchmark [NUM_VIEWS ...]
// Pair selection and guided matching of long tours (default: 250, 500 and 1000 views) with 4000
// features each: views along a wall of points, predictions with errors, features kept in 256 MiB.
// Prints time per step and pair, and the peak of memory.
#include "matching/match_views.h"
#include "matching/pair_selection.h"
#include "scene/memory.h"
#include "scene/random.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace vgtw {
namespace {

constexpr size_t kNumFeatures = 4000;
constexpr double kStep = 0.4;              // between views
constexpr double kDistance = 4.0;          // from the wall
constexpr double kPointsPerMetre = 750.0;  // along the wall, which is 4 high and 1 deep

Eigen::Vector3d WallPoint(uint64_t idx) {
  RandomStream random(HashKey({1, idx}));
  return {static_cast<double>(idx) / kPointsPerMetre,
          random.Uniform(-2.0, 2.0),
          kDistance + random.Uniform(-0.5, 0.5)};
}

View TrueView(size_t idx) {
  View view;
  view.name = std::to_string(idx);
  view.camera = MakePinhole(1000, 750, 800.0, 800.0);
  view.cam_from_world.translation = {-kStep * static_cast<double>(idx), 0.0, 0.0};
  return view;
}

View PredictedView(size_t idx) {
  RandomStream random(HashKey({2, idx}));
  View view = TrueView(idx);
  const Eigen::Vector3d axis = random.NormalVector().normalized();
  const Rigid3d turn = {RotationAboutAxis(axis, 0.5 * random.Normal()),
                        0.02 * random.NormalVector()};
  view.cam_from_world = turn * view.cam_from_world;
  return view;
}

// The wall's points in the view, as many as features; each with its own descriptor and some noise.
ViewFeatures MakeFeatures(size_t view_idx) {
  const View truth = TrueView(view_idx);
  RandomStream random(HashKey({3, view_idx}));
  Features features;
  features.keypoints.cols = 4;
  features.descriptors.cols = 128;
  std::vector<float> depths;
  const double centre = kStep * static_cast<double>(view_idx);
  const auto first = static_cast<uint64_t>(std::max(0.0, (centre - 2.8) * kPointsPerMetre));
  for (uint64_t idx = first; depths.size() < kNumFeatures; ++idx) {
    const Eigen::Vector3d point_in_cam = truth.cam_from_world * WallPoint(idx);
    if (point_in_cam.x() > 2.8) break;
    const Eigen::Vector2d pixel = *Project(truth.camera, point_in_cam);
    const double x = pixel.x() + 0.5 * random.Normal();
    const double y = pixel.y() + 0.5 * random.Normal();
    for (const double value : {x, y, 3.0 * kDistance / point_in_cam.z(), 0.0}) {
      features.keypoints.data.push_back(static_cast<float>(value));
    }
    RandomStream look(HashKey({4, idx}));
    for (int k = 0; k < 128; ++k) {
      const double value = look.Uniform(0, 90) + 8.0 * random.Normal();
      features.descriptors.data.push_back(static_cast<uint8_t>(std::clamp(value, 0.0, 255.0)));
    }
    depths.push_back(static_cast<float>(point_in_cam.z() * (1.0 + 0.03 * random.Normal())));
  }
  features.keypoints.rows = features.descriptors.rows = static_cast<uint32_t>(depths.size());
  ViewFeatures result = MakeViewFeatures(PredictedView(view_idx), std::move(features), nullptr);
  result.depths = depths;
  result.depth_confs.assign(depths.size(), 1.0f);
  return result;
}

ViewSketch MakeSketch(size_t view_idx) {
  ViewPrediction prediction;
  prediction.view = PredictedView(view_idx);
  prediction.view.network_width = 100;
  prediction.view.network_height = 75;
  prediction.view.original_from_network << 10.0, 0.0, 0.0, 0.0, 10.0, 0.0;
  prediction.depth = DepthMap(100, 75, static_cast<float>(kDistance));
  return MakeViewSketch(StaticView(std::move(prediction), 0.5), 0.0);
}

double Seconds(const auto& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void Run(size_t num_views) {
  std::vector<ViewSketch> sketches;
  std::vector<ViewPair> pairs;
  for (size_t i = 0; i < num_views; ++i) sketches.push_back(MakeSketch(i));
  const double selection_sec = Seconds([&] { pairs = SelectPairs(sketches, {}); });
  MatchViewsOptions options;
  options.max_memory = int64_t{256} << 20;
  options.pair.uncertainty.centre = 0.08;
  size_t num_matches = 0;
  double loading_sec = 0.0;
  const double matching_sec = Seconds([&] {
    MatchViews(
        pairs,
        num_views,
        [&](size_t idx) {
          ViewFeatures features;
          loading_sec += Seconds([&] { features = MakeFeatures(idx); });
          return features;
        },
        [&](size_t, const MatchedPair& pair) {
          num_matches += pair.geometry.inlier_matches.size();
        },
        options);
  });
  std::printf("%6zu %8zu %11.2f %12.1f %12.1f %10.1f %12.0f %9.0f\n",
              num_views,
              pairs.size(),
              selection_sec,
              matching_sec,
              loading_sec,
              1e3 * matching_sec / static_cast<double>(pairs.size()),
              static_cast<double>(num_matches) / static_cast<double>(pairs.size()),
              static_cast<double>(PeakMemory()) / 1048576.0);
  std::fflush(stdout);
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  std::printf(
      " views    pairs selection s   matching s (making s)    ms/pair matches/pair  peak MiB\n");
  std::vector<size_t> sizes;
  for (int i = 1; i < argc; ++i) sizes.push_back(std::strtoull(argv[i], nullptr, 10));
  if (sizes.empty()) sizes = {250, 500, 1000};
  for (const size_t num_views : sizes) vgtw::Run(num_views);
  return 0;
}
