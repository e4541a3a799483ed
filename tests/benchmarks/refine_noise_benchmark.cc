// SPDX-License-Identifier: BSD-3-Clause
// refine_noise_benchmark DATABASE REFERENCE [NUM_SEEDS [LEVEL ...]]
// Refinement from a reference model's poses with errors of rotation (degrees; centres get twice as
// many percent of the extent, at least 0.5, focal lengths four times as many, at most 20), beside
// what it makes of nearly true poses: error against the reference, median over the seeds and worst,
// and how many seeds end within 1.2 times of what nearly true poses reach in the median.
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "evaluation/pose_error.h"
#include "plugin/database_tracks.h"
#include "refine/refine_model.h"
#include "scene/error.h"
#include "scene/statistics.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

namespace {

using namespace vgtw;  // NOLINT(google-build-using-namespace): a program

// The floor is measured from here, since refinement keeps poses that are as good as it could get.
constexpr double kFloorLevelDeg = 0.05;

Eigen::Vector3d RandomVector(std::mt19937& random, double rms_length) {
  std::normal_distribution<double> normal(0.0, rms_length / std::sqrt(3.0));
  const double x = normal(random);
  const double y = normal(random);
  return {x, y, normal(random)};
}

Reconstruction WithErrors(Reconstruction model, double level_deg, unsigned seed) {
  if (level_deg <= 0.0) return model;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<Eigen::Vector3d> centres;
  for (const auto& [id, image] : model.images) {
    centres.push_back(OriginInSource(image.cam_from_world));
  }
  const double centre_error = std::min(0.02 * level_deg, 0.1) * Diameter(centres);
  const double focal_error = std::min(0.04 * level_deg, 0.2);
  for (auto& [id, camera] : model.cameras) {
    const double factor = std::max(1.0 + focal_error * normal(random), 0.4);
    camera.SetFocalLength(factor * camera.FocalLengthX(), factor * camera.FocalLengthY());
  }
  for (auto& [id, image] : model.images) {
    const Eigen::Vector3d axis = RandomVector(random, 1.0).normalized();
    const Eigen::Quaterniond rotation =
        (RotationAboutAxis(axis, level_deg * normal(random)) * image.cam_from_world.rotation)
            .normalized();
    const Eigen::Vector3d centre =
        OriginInSource(image.cam_from_world) + RandomVector(random, centre_error);
    image.cam_from_world = {rotation, -(rotation * centre)};
  }
  model.points3D.clear();
  for (auto& [id, image] : model.images) {
    for (Point2D& point2D : image.points2D) point2D.point3D_id = kInvalidPoint3DId;
  }
  UpdateFrames(model);
  return model;
}

struct Outcome {
  double start_deg, start_percent, end_deg, end_percent;
  double seconds;
  size_t num_refined, num_points;
  double held_out_before_px, held_out_after_px;
};

Outcome Refine(const Reconstruction& reference,
               const std::vector<Track>& tracks,
               double level_deg,
               unsigned seed) {
  const Reconstruction start = WithErrors(reference, level_deg, seed);
  const auto begin = std::chrono::steady_clock::now();
  const RefineModelResult result = RefineModel({}, start, tracks);
  const auto truth = CamFromWorldByName(reference);
  const auto before = ComparePoses(CamFromWorldByName(start), truth);
  const auto after = ComparePoses(CamFromWorldByName(result.refined), truth);
  if (std::getenv("VERBOSE")) {
    for (const RefineRound& round : result.rounds) {
      std::printf(
          "   limit %.1f px, %zu points, median %.2f px, held out %.3f px, %s, put back %zu, it "
          "%d\n",
          round.max_error_px,
          round.num_points3D,
          round.median_px,
          round.held_out_px,
          round.is_accepted ? "accepted" : "undone",
          round.put_back.size(),
          round.adjustment.num_iterations);
    }
    for (const auto& [id, view] : result.views) {
      if (!view.reason.empty())
        std::printf("   %s: %s: %s\n",
                    view.name.c_str(),
                    std::string(Name(view.outcome)).c_str(),
                    view.reason.c_str());
    }
  }
  const auto num_refined =
      std::count_if(result.views.begin(), result.views.end(), [](const auto& v) {
        return v.second.outcome == ViewOutcome::kRefined;
      });
  return {before->relative_rotation_median_deg,
          before->centre_rmse_percent,
          after->relative_rotation_median_deg,
          after->centre_rmse_percent,
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
          static_cast<size_t>(num_refined),
          result.refined.points3D.size(),
          result.held_out_before_px,
          result.held_out_after_px};
}

void Print(double level_deg, unsigned seed, const Outcome& outcome) {
  std::printf(
      "%.2f deg #%u: start %.3f deg %.3f %%, held out %.3f px | end %.3f deg %.3f %%, %.3f px, %zu "
      "refined, "
      "%zu points, %.1f s\n",
      level_deg,
      seed,
      outcome.start_deg,
      outcome.start_percent,
      outcome.held_out_before_px,
      outcome.end_deg,
      outcome.end_percent,
      outcome.held_out_after_px,
      outcome.num_refined,
      outcome.num_points,
      outcome.seconds);
  std::fflush(stdout);
}

struct Level {
  std::vector<double> degs, percents;
};

Level RunLevel(const Reconstruction& reference,
               const std::vector<Track>& tracks,
               double level_deg,
               int num_seeds) {
  Level level;
  for (int seed = 1; seed <= num_seeds; ++seed) {
    const Outcome outcome = Refine(reference, tracks, level_deg, static_cast<unsigned>(seed));
    Print(level_deg, static_cast<unsigned>(seed), outcome);
    level.degs.push_back(outcome.end_deg);
    level.percents.push_back(outcome.end_percent);
  }
  std::printf("== %.2f deg: median %.3f deg %.3f %%, worst %.3f deg %.3f %%\n",
              level_deg,
              Median(level.degs),
              Median(level.percents),
              Percentile(level.degs, 100.0),
              Percentile(level.percents, 100.0));
  return level;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 3) {
      std::fprintf(stderr, "refine_noise_benchmark DATABASE REFERENCE [NUM_SEEDS [LEVEL ...]]\n");
      return 2;
    }
    const ColmapDatabase database(argv[1], ColmapDatabase::Mode::kReadOnly);
    Reconstruction reference = ReadModel(argv[2]);
    const std::vector<Track> tracks = ReadTracks(database, reference);
    const int num_seeds = argc > 3 ? std::atoi(argv[3]) : 20;
    std::vector<double> levels;
    for (int i = 4; i < argc; ++i) levels.push_back(std::atof(argv[i]));
    if (levels.empty()) levels = {0.25, 0.5, 1.0, 2.0, 5.0};
    std::printf("%zu images, %zu tracks\n", reference.images.size(), tracks.size());
    Print(0.0, 0, Refine(reference, tracks, 0.0, 0));
    const Level floor = RunLevel(reference, tracks, kFloorLevelDeg, num_seeds);
    for (const double level : levels) {
      const Level ends = RunLevel(reference, tracks, level, num_seeds);
      size_t num_converged = 0;
      for (size_t i = 0; i < ends.degs.size(); ++i) {
        num_converged += ends.degs[i] <= 1.2 * Median(floor.degs) &&
                         ends.percents[i] <= 1.2 * Median(floor.percents);
      }
      std::printf("   within 1.2 times the floor: %zu of %zu\n", num_converged, ends.degs.size());
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
