// SPDX-License-Identifier: BSD-3-Clause
// pair_selection_benchmark [NUM_VIEWS ...]
// Time and memory of pair selection, by default of 250, 500, 1000 and 2000 views along all streets
// of a city of square blocks that grows with them, against measuring every pair in the same run;
// how time grows; and how many of each view's best pairs are found. Geometry alone, nothing is
// rendered.
#include "matching/pair_selection.h"
#include "scene/memory.h"
#include "scene/parallel.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <set>
#include <sys/wait.h>
#include <utility>
#include <vector>

#include <unistd.h>

namespace vgtw {
namespace {

constexpr double kPitch = 60.0;  // m, between the middles of streets
constexpr double kStreetWidth = 16.0;
constexpr double kRoofHeight = 25.0;
constexpr double kEyeHeight = 1.7;
constexpr double kStep = 1.5;        // m between photos, about
constexpr double kMaxRange = 300.0;  // m

struct City {
  int num_blocks = 1;  // per side

  double Extent() const { return num_blocks * kPitch; }
  double StreetLength() const { return 2.0 * (num_blocks + 1) * Extent(); }
};

City CityOf(int num_views) {
  return {std::max(1, static_cast<int>(std::lround(std::sqrt(num_views * kStep / kPitch / 2.0))))};
}

// Where a ray enters the building of the block that `cell` names; infinity if it misses it.
double BuildingDistance(const Eigen::Vector2d& origin,
                        const Eigen::Vector2d& direction,
                        const Eigen::Vector2d& cell) {
  const Eigen::Array2d min = (cell * kPitch).array() + 0.5 * kStreetWidth;
  const Eigen::Array2d max = min + kPitch - kStreetWidth;
  const Eigen::Array2d at_min = (min - origin.array()) / direction.array();
  const Eigen::Array2d at_max = (max - origin.array()) / direction.array();
  const double enter = at_min.min(at_max).maxCoeff();
  const double leave = at_min.max(at_max).minCoeff();
  return enter > 0.0 && enter <= leave ? enter : std::numeric_limits<double>::infinity();
}

// Length of the ray, in units of `direction`, up to a wall or the ground; NaN for the sky.
double Cast(const City& city, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const double ground = direction.z() < 0.0 ? -origin.z() / direction.z() : kMaxRange;
  const Eigen::Vector2d origin_2d = origin.head<2>();
  const Eigen::Vector2d direction_2d = direction.head<2>();
  double distance = ground;
  for (double entered = 1e-9; entered < std::min(ground, kMaxRange);) {
    const Eigen::Vector2d cell =
        ((origin_2d + (entered + 1e-6) * direction_2d) / kPitch).array().floor();
    if ((cell.array() >= 0.0).all() && (cell.array() < city.num_blocks).all()) {
      distance = std::min(distance, BuildingDistance(origin_2d, direction_2d, cell));
      if (distance < ground) break;
    }
    const Eigen::Array2d next =
        (cell.array() + (direction_2d.array() > 0.0).cast<double>()) * kPitch;
    entered = ((next - origin_2d.array()) / direction_2d.array()).minCoeff();
  }
  const bool is_sky = distance >= kMaxRange || origin.z() + distance * direction.z() > kRoofHeight;
  return is_sky ? std::numeric_limits<double>::quiet_NaN() : distance;
}

// A place on the way through all streets, first those along x, and its direction.
std::pair<Eigen::Vector3d, Eigen::Vector3d> PlaceAt(const City& city, double way) {
  const int street = std::min(static_cast<int>(way / city.Extent()), 2 * city.num_blocks + 1);
  const bool is_along_x = street <= city.num_blocks;
  const double across = (street % (city.num_blocks + 1)) * kPitch;
  const double along = way - street * city.Extent();
  if (is_along_x) return {{along, across, kEyeHeight}, {1.0, 0.0, 0.0}};
  return {{across, along, kEyeHeight}, {0.0, 1.0, 0.0}};
}

// Photos look ahead, to the left and to the right in turns.
ViewSketch SketchView(const City& city, int view_idx, int num_views) {
  ViewPrediction prediction;
  View& view = prediction.view;
  view.camera = MakePinhole(640, 480, 500.0, 500.0);
  view.network_width = 64;
  view.network_height = 48;
  view.original_from_network << 10.0, 0.0, 0.0, 0.0, 10.0, 0.0;
  const auto [place, ahead] = PlaceAt(city, city.StreetLength() * (view_idx + 0.5) / num_views);
  constexpr double kTurns_deg[] = {3.0, 63.0, -57.0};  // never along a wall
  const Eigen::Vector3d direction =
      RotationAboutAxis(Eigen::Vector3d::UnitZ(), kTurns_deg[view_idx % 3]) * ahead;
  view.cam_from_world = LookAt(place, place + direction, Eigen::Vector3d::UnitZ());
  prediction.depth = DepthMap(64, 48);
  const Eigen::Matrix3d world_from_cam =
      view.cam_from_world.rotation.conjugate().toRotationMatrix();
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const Eigen::Vector3d ray((x - 31.5) / 50.0, (y - 23.5) / 50.0, 1.0);  // z-depth 1
      prediction.depth(x, y) = static_cast<float>(Cast(city, place, world_from_cam * ray));
    }
  }
  return MakeViewSketch(StaticView(std::move(prediction), 0.5), 0.0);
}

std::vector<ViewSketch> SketchAll(const City& city, int num_views) {
  std::vector<ViewSketch> sketches(static_cast<size_t>(num_views));
  ParallelFor(num_views, 0, [&](int64_t i) {
    sketches[static_cast<size_t>(i)] = SketchView(city, static_cast<int>(i), num_views);
  });
  return sketches;
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Run {
  int num_views = 0;
  double select_sec = 0.0;
  double memory_mib = 0.0;  // at most, above what the sketches take
  std::vector<ViewPair> pairs;
};

Run Select(const City& city, int num_views) {
  Run run;
  run.num_views = num_views;
  const std::vector<ViewSketch> sketches = SketchAll(city, num_views);
  const int64_t resident = ResidentMemory();
  const auto start = std::chrono::steady_clock::now();
  run.pairs = SelectPairs(sketches, {});
  run.select_sec = SecondsSince(start);
  run.memory_mib = static_cast<double>(PeakMemory() - resident) / 1024.0 / 1024.0;
  return run;
}

std::vector<std::vector<ViewPair>> MeasureAll(const std::vector<ViewSketch>& sketches) {
  const Covisibility covisibility(sketches, {});
  std::vector<std::vector<ViewPair>> pairs(sketches.size());
  ParallelFor(static_cast<int64_t>(sketches.size()), 0, [&](int64_t i) {
    for (size_t j = static_cast<size_t>(i) + 1; j < sketches.size(); ++j) {
      const auto pair = covisibility.Measure(static_cast<size_t>(i), j);
      if (pair) pairs[static_cast<size_t>(i)].push_back(*pair);
    }
  });
  return pairs;
}

// Of the num_best good pairs of each view among all pairs, the share that was chosen.
double Recall(const Run& run, const std::vector<std::vector<ViewPair>>& all) {
  const PairSelectionOptions options;
  std::vector<std::vector<ViewPair>> by_view(all.size());
  for (const auto& pairs : all) {
    for (const ViewPair& pair : pairs) {
      if (pair.covisibility < options.min_covisibility) continue;
      if (pair.angle_deg < options.min_angle_deg) continue;
      by_view[pair.view_idx1].push_back(pair);
      by_view[pair.view_idx2].push_back(pair);
    }
  }
  std::set<std::pair<size_t, size_t>> chosen;
  for (const ViewPair& pair : run.pairs) chosen.emplace(pair.view_idx1, pair.view_idx2);
  size_t num_best = 0;
  size_t num_found = 0;
  for (auto& pairs : by_view) {
    std::stable_sort(pairs.begin(), pairs.end(), [](const ViewPair& a, const ViewPair& b) {
      return a.covisibility > b.covisibility;
    });
    pairs.resize(std::min(pairs.size(), static_cast<size_t>(options.num_best)));
    num_best += pairs.size();
    for (const ViewPair& pair : pairs) num_found += chosen.count({pair.view_idx1, pair.view_idx2});
  }
  return static_cast<double>(num_found) / static_cast<double>(num_best);
}

template <typename CityOfNumViews>
void Print(const std::vector<int>& sizes, const CityOfNumViews& city_of) {
  std::vector<Run> runs;
  for (const int num_views : sizes) runs.push_back(Select(city_of(num_views), num_views));
  std::printf("views  pairs chosen  select (s)  memory (MiB)  all pairs (s)  ratio  recall\n");
  for (const Run& run : runs) {
    const std::vector<ViewSketch> sketches = SketchAll(city_of(run.num_views), run.num_views);
    const auto start = std::chrono::steady_clock::now();
    const std::vector<std::vector<ViewPair>> all = MeasureAll(sketches);
    const double all_sec = SecondsSince(start);
    std::printf("%5d  %12zu  %10.3f  %12.1f  %13.3f  %5.1f  %6.4f\n",
                run.num_views,
                run.pairs.size(),
                run.select_sec,
                run.memory_mib,
                all_sec,
                all_sec / run.select_sec,
                Recall(run, all));
    std::fflush(stdout);
  }
  if (runs.size() < 2) return;
  std::printf("time grows with the number of views to the power of %.2f\n",
              std::log(runs.back().select_sec / runs.front().select_sec) /
                  std::log(1.0 * runs.back().num_views / runs.front().num_views));
}

// In a process of its own, for the peak of memory never falls.
template <typename CityOfNumViews>
void PrintApart(const std::vector<int>& sizes, const CityOfNumViews& city_of) {
  std::fflush(stdout);
  const pid_t child = ::fork();
  if (child == 0) {
    Print(sizes, city_of);
    std::fflush(stdout);
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
}

}  // namespace
}  // namespace vgtw

int main(int argc, char** argv) {
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) sizes.push_back(std::max(1, std::atoi(argv[i])));
  if (sizes.empty()) sizes = {250, 500, 1000, 2000};
  std::sort(sizes.begin(), sizes.end());  // peak memory only grows
  std::printf("a city that grows\n");
  vgtw::PrintApart(sizes, vgtw::CityOf);
  std::printf("one block\n");
  vgtw::PrintApart(sizes, [](int) { return vgtw::City{}; });
}
