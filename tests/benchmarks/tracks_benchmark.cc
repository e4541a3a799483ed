// SPDX-License-Identifier: BSD-3-Clause
// tracks_benchmark
// Time and memory of tracks, scales of depth and lifted points for 250, 500 and 1000 views in a row
// of 4000 keypoints each, 19 pairs per view of 200 matches each, 5 % of which are wrong. Memory is
// the peak of the process beyond what it held before tracks were built, so that the largest comes
// last.
#include "matching/track_lifting.h"
#include "matching/tracks.h"
#include "scene/memory.h"
#include "scene/random.h"

#include <chrono>
#include <cstdio>
#include <map>
#include <vector>

namespace vgtw {
namespace {

constexpr uint32_t kNumKeypoints = 4000;
constexpr uint32_t kNewPerView = 200;  // points; each is in sight over 20 views
constexpr uint32_t kPairsPerView = 19;
constexpr uint32_t kMatchesPerPair = 200;
constexpr double kStep = 0.05;  // between views; the points lie 4 to 8 in front of them

Eigen::Vector3d PointOf(uint32_t point) {
  RandomStream random(HashKey({point, 7}));
  const double x = kStep * (point / static_cast<double>(kNewPerView)) + random.Uniform(-1.0, 1.0);
  const double y = random.Uniform(-2.0, 2.0);
  return {x, y, random.Uniform(4.0, 8.0)};
}

// Keypoint k of a view shows point kNewPerView * view + k.
std::map<ImageId, ViewFeatures> MakeViews(uint32_t num_views) {
  std::map<ImageId, ViewFeatures> views;
  for (uint32_t v = 0; v < num_views; ++v) {
    ViewFeatures& view = views[v];
    view.view.cam_from_world.translation = {-kStep * v, 0.0, 0.0};
    RandomStream random(HashKey({v, 8}));
    const double factor = random.Uniform(0.9, 1.1);
    for (uint32_t k = 0; k < kNumKeypoints; ++k) {
      const Eigen::Vector3d point = view.view.cam_from_world * PointOf(kNewPerView * v + k);
      view.pixels.emplace_back(1000.0f * point.cast<float>().hnormalized());
      view.rays.emplace_back(point.cast<float>().hnormalized());
      view.scales.push_back(2.0f);
      view.depths.push_back(static_cast<float>(factor * point.z() * (1 + 0.02 * random.Normal())));
      view.depth_confs.push_back(1.0f);
    }
  }
  return views;
}

std::vector<PairMatches> MakePairs(uint32_t num_views) {
  std::vector<PairMatches> pairs;
  for (uint32_t v = 0; v < num_views; ++v) {
    for (uint32_t step = 1; step <= kPairsPerView && v + step < num_views; ++step) {
      RandomStream random(HashKey({v, step, 9}));
      PairMatches& pair = pairs.emplace_back(PairMatches{v, v + step, {}});
      for (uint32_t m = 0; m < kMatchesPerPair; ++m) {
        // Every fourth keypoint is one that detectors find again.
        const double min = kNewPerView * step / 4.0;
        const auto k = 4 * static_cast<uint32_t>(random.Uniform(min, kNumKeypoints / 4.0));
        const uint32_t wrong = random.Uniform() < 0.05 ? 4 : 0;
        pair.matches.push_back({k, k - kNewPerView * step + wrong});
      }
    }
  }
  return pairs;
}

class Timer {
 public:
  double Lap() {
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> seconds = now - start_;
    start_ = now;
    return seconds.count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void Measure(uint32_t num_views) {
  constexpr double kMib = 1024.0 * 1024.0;
  const std::map<ImageId, ViewFeatures> views = MakeViews(num_views);
  const std::vector<PairMatches> pairs = MakePairs(num_views);
  std::map<ImageId, TrackImage> images;
  for (const auto& [image_id, view] : views) images[image_id] = {{}, view.pixels, view.scales};
  const auto before = static_cast<double>(ResidentMemory());
  Timer timer;
  const Tracks built = BuildTracks(pairs, images);
  const double seconds_build = timer.Lap();
  const double mib_build = (static_cast<double>(PeakMemory()) - before) / kMib;
  const DepthScales scales = EstimateDepthScales(views, built.tracks);
  const double seconds_scales = timer.Lap();
  const LiftedTracks lifted = LiftTracks(views, built.tracks, scales, {.num_threads = 1});
  const double seconds_lift = timer.Lap();
  std::printf("%5u %7zu %9zu %8zu %8zu %8zu   %7.2f %7.2f %7.2f   %7.0f %7.0f\n",
              num_views,
              pairs.size(),
              built.summary.num_matches,
              built.summary.num_refused_matches,
              built.tracks.size(),
              lifted.num_lifted,
              seconds_build,
              seconds_scales,
              seconds_lift,
              mib_build,
              (static_cast<double>(PeakMemory()) - before) / kMib);
  std::fflush(stdout);
}

}  // namespace
}  // namespace vgtw

int main() {
  std::printf(
      "views   pairs   matches  refused   tracks   lifted   tracks  scales  lift s   "
      "tracks  all MiB\n");
  for (const uint32_t num_views : {250, 500, 1000}) vgtw::Measure(num_views);
}
