// SPDX-License-Identifier: BSD-3-Clause
// refine_noise_benchmark DATABASE REFERENCE [NUM_SEEDS [LEVEL ...]]
//
// Refinement from a reference model's poses with errors of rotation (sigma in degrees; centres get
// twice as many percent of the extent, at most 10, focal lengths four times as many, at most 20),
// beside what it makes of nearly true poses, the floor. Prints the error against the reference per
// seed, median and worst per level, and how many seeds end within 1.2 times the floor.
//
// With COLMAP=EXECUTABLE in the environment its own loop, four times point_triangulator and
// bundle_adjuster, runs from the same starts. VERBOSE=1 tells of rounds and of views left as they
// were.
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "evaluation/pose_error.h"
#include "plugin/colmap.h"
#include "plugin/database_tracks.h"
#include "plugin/refine_report.h"
#include "plugin/table.h"
#include "refine/refine_model.h"
#include "scene/statistics.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <random>

namespace {

using namespace vgtw;  // NOLINT(google-build-using-namespace): a program

// The floor is measured from here, since refinement keeps poses that are as good as it could get.
constexpr double kFloorLevelDeg = 0.05;

Eigen::Vector3d RandomVector(std::mt19937& random, double rms_length) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return rms_length / std::sqrt(3.0) * Eigen::Vector3d(x, y, normal(random));
}

Reconstruction WithErrors(Reconstruction model, double level_deg, unsigned seed) {
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
    const Eigen::Quaterniond change = RotationAboutAxis(axis, level_deg * normal(random));
    const Eigen::Quaterniond rotation = (change * image.cam_from_world.rotation).normalized();
    const Eigen::Vector3d centre =
        OriginInSource(image.cam_from_world) + RandomVector(random, centre_error);
    image.cam_from_world = {rotation, -(rotation * centre)};
    for (Point2D& point2D : image.points2D) point2D.point3D_id = kInvalidPoint3DId;
  }
  model.points3D.clear();
  UpdateFrames(model);
  return model;
}

struct PoseErrors {
  double deg = std::numeric_limits<double>::infinity();
  double percent = std::numeric_limits<double>::infinity();
};

PoseErrors ErrorsOf(const Reconstruction& model, const Reconstruction& reference) {
  const auto error = ComparePoses(CamFromWorldByName(model), CamFromWorldByName(reference));
  if (!error) return {};
  return {error->relative_rotation_median_deg, error->centre_rmse_percent};
}

std::string Text(const PoseErrors& errors) {
  return FormatNumber(errors.deg, 3) + " deg " + FormatNumber(errors.percent, 3) + " %";
}

void PrintDetails(const RefineModelResult& result) {
  for (const RefineRound& round : result.rounds) {
    std::cout << "   limit " << FormatNumber(round.max_error_px, 1) << " px, " << round.num_points3D
              << " points, median " << FormatNumber(round.median_px, 2) << " px, held out "
              << FormatNumber(round.held_out_px, 3) << " px, "
              << (round.is_accepted ? "accepted, " : "undone, ") << round.put_back.size()
              << " put back, " << round.adjustment.num_iterations << " iterations\n";
  }
  for (const std::string& note : UnrefinedNotes(AsJson(result).at("views"))) {
    std::cout << "   " << note << "\n";
  }
}

PoseErrors Refine(const Reconstruction& start,
                  const std::vector<Track>& tracks,
                  const Reconstruction& reference) {
  const auto begin = std::chrono::steady_clock::now();
  const RefineModelResult result = RefineModel({}, start, tracks);
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  const PoseErrors errors = ErrorsOf(result.refined, reference);
  std::cout << "refined " << Text(errors) << ", held out "
            << FormatNumber(result.held_out_before_px, 3) << " -> "
            << FormatNumber(result.held_out_after_px, 3) << " px, "
            << FormatNumber(seconds.count(), 1) << " s";
  if (std::getenv("VERBOSE")) {
    std::cout << "\n";
    PrintDetails(result);
  }
  return errors;
}

PoseErrors RunColmapLoop(const Colmap& colmap,
                         const std::filesystem::path& database_path,
                         Reconstruction start,
                         const Reconstruction& reference) {
  const TemporaryFolder folder;
  for (auto& [id, image] : start.images) image.points2D.clear();
  // A folder of its own: frames of COLMAP >= 3.12 that stay beside newer poses would be read.
  WriteModel(start, folder / "start");
  std::filesystem::create_directories(folder / "triangulated");
  std::filesystem::create_directories(folder / "adjusted");
  for (int i = 0; i < 4; ++i) {
    colmap.Run("point_triangulator",
               {{"database_path", database_path},
                {"image_path", folder.path()},
                {"input_path", folder / (i == 0 ? "start" : "adjusted")},
                {"output_path", folder / "triangulated"},
                {"clear_points", "1"},
                {"Mapper.extract_colors", "0"}},
               folder / "log");
    colmap.Run("bundle_adjuster",
               {{"input_path", folder / "triangulated"}, {"output_path", folder / "adjusted"}},
               folder / "log");
  }
  const PoseErrors errors = ErrorsOf(ReadModel(folder / "adjusted"), reference);
  std::cout << " | colmap " << Text(errors);
  return errors;
}

struct Level {
  std::vector<double> degs;
  std::vector<double> percents;

  void Add(const PoseErrors& errors) {
    degs.push_back(errors.deg);
    percents.push_back(errors.percent);
  }
  size_t NumWithin(const PoseErrors& limit) const {
    size_t num = 0;
    for (size_t i = 0; i < degs.size(); ++i) {
      num += degs[i] <= limit.deg && percents[i] <= limit.percent;
    }
    return num;
  }
};

class Benchmark {
 public:
  Benchmark(const std::filesystem::path& database_path, const std::filesystem::path& reference_path)
      : database_path_(database_path), reference_(ReadModel(reference_path)) {
    tracks_ =
        ReadTracks(ColmapDatabase(database_path, ColmapDatabase::Mode::kReadOnly), reference_);
    if (const char* executable = std::getenv("COLMAP")) colmap_.emplace(executable);
    std::cout << reference_.images.size() << " images, " << tracks_.size() << " tracks\n";
  }

  void Run(int num_seeds, const std::vector<double>& levels_deg) {
    const Level at_floor = RunLevel(kFloorLevelDeg, num_seeds, false).first;
    floor_ = {Median(at_floor.degs), Median(at_floor.percents)};
    for (const double level_deg : levels_deg) {
      const auto [ours, colmaps] = RunLevel(level_deg, num_seeds, colmap_.has_value());
      PrintLevel("refined", level_deg, ours);
      if (!colmaps.degs.empty()) PrintLevel("colmap", level_deg, colmaps);
    }
  }

 private:
  std::pair<Level, Level> RunLevel(double level_deg, int num_seeds, bool with_colmap) const {
    Level ours, colmaps;
    for (int seed = 1; seed <= num_seeds; ++seed) {
      const Reconstruction start = WithErrors(reference_, level_deg, static_cast<unsigned>(seed));
      std::cout << FormatNumber(level_deg, 2) << " deg #" << seed << ": start "
                << Text(ErrorsOf(start, reference_)) << " | ";
      ours.Add(Refine(start, tracks_, reference_));
      if (with_colmap) colmaps.Add(RunColmapLoop(*colmap_, database_path_, start, reference_));
      std::cout << std::endl;
    }
    return {ours, colmaps};
  }

  void PrintLevel(const char* name, double level_deg, const Level& level) const {
    std::cout << "== " << name << " from " << FormatNumber(level_deg, 2) << " deg: median "
              << Text({Median(level.degs), Median(level.percents)}) << ", worst "
              << Text({Percentile(level.degs, 100.0), Percentile(level.percents, 100.0)})
              << ", within 1.2 times the floor (" << Text(floor_)
              << "): " << level.NumWithin({1.2 * floor_.deg, 1.2 * floor_.percent}) << " of "
              << level.degs.size() << std::endl;
  }

  std::filesystem::path database_path_;
  Reconstruction reference_;
  std::vector<Track> tracks_;
  std::optional<Colmap> colmap_;
  PoseErrors floor_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "refine_noise_benchmark DATABASE REFERENCE [NUM_SEEDS [LEVEL ...]]\n";
    return 2;
  }
  try {
    std::vector<double> levels_deg;
    for (int i = 4; i < argc; ++i) levels_deg.push_back(std::atof(argv[i]));
    if (levels_deg.empty()) levels_deg = {0.25, 0.5, 1.0, 2.0, 5.0};
    Benchmark(argv[1], argv[2]).Run(argc > 3 ? std::atoi(argv[3]) : 20, levels_deg);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
  }
}
