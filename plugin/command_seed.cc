// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/point_cloud.h"
#include "bridge/seed.h"
#include "plugin/commands.h"
#include "plugin/table.h"
#include "plugin/track_stage.h"
#include "scene/error.h"
#include "scene/reprojection.h"

#include <memory>
#include <optional>

namespace vgtw {
namespace {

struct SeedCommand {
  std::filesystem::path predictions_path;
  std::filesystem::path database_path;
  std::filesystem::path output_path;
  std::filesystem::path ply_path;
  std::filesystem::path pcd_path;
  std::string output_type = "BIN";
  SeedOptions options;
  bool with_tracks = false;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    const PredictionReader predictions(predictions_path);
    if (with_tracks && database_path.empty()) {
      throw Error("--tracks takes the matches of a database, expected --database_path");
    }
    options.with_points = options.with_points && !with_tracks;
    std::optional<ColmapDatabase> database;
    if (!database_path.empty()) {
      database.emplace(database_path, ColmapDatabase::Mode::kReadOnly);
    }
    Seed seed =
        database ? MakeSeed(predictions, *database, options) : MakeSeed(predictions, options);
    if (with_tracks) AddTracks(predictions, *database, seed);
    WriteModelOptions write;
    write.format = output_type == "TXT" ? ModelFormat::kText : ModelFormat::kBinary;
    write.overwrite = overwrite;
    WriteModel(seed.reconstruction, output_path, write);
    if (!ply_path.empty()) WritePly(ply_path, PointsOf(seed.reconstruction));
    if (!pcd_path.empty()) WritePcd(pcd_path, PointsOf(seed.reconstruction));
    Finish(usability, Text(seed), Json(seed));
  }

  void AddTracks(const PredictionReader& predictions,
                 const ColmapDatabase& database,
                 Seed& seed) const {
    TrackStageOptions tracks;
    tracks.distractor_threshold = options.distractor_threshold;
    tracks.num_threads = options.num_threads;
    AddLiftedTracks(predictions, database, tracks, seed.reconstruction);
    const ReprojectionStats stats = ComputeReprojectionStats(seed.reconstruction);
    seed.summary.num_points3D = stats.num_points3D;
    seed.summary.mean_track_length = stats.mean_track_length;
  }

  std::string Text(const Seed& seed) const {
    const SeedSummary& summary = seed.summary;
    std::string text = std::to_string(summary.num_images) + " images, " +
                       std::to_string(summary.num_points3D) + " points, mean track " +
                       FormatNumber(summary.mean_track_length, 2) + " views\n";
    if (options.shared_camera) {
      text += "shared camera: focal lengths spread by " +
              FormatNumber(summary.focal_spread_percent, 2) + " % of their median\n";
    }
    for (const std::string& name : seed.missing) {
      text += "note: " + name + " has a prediction but is not in the database\n";
    }
    return text + "written: " + output_path.string() + "\n";
  }

  nlohmann::json Json(const Seed& seed) const {
    return {{"num_images", seed.summary.num_images},
            {"num_points3D", seed.summary.num_points3D},
            {"mean_track_length", seed.summary.mean_track_length},
            {"confidence_threshold", seed.summary.confidence_threshold},
            {"focal_spread_percent", seed.summary.focal_spread_percent},
            {"missing", seed.missing},
            {"output_path", output_path.string()}};
  }
};

}  // namespace

std::function<void()> DeclareSeed(Flags& flags) {
  const auto command = std::make_shared<SeedCommand>();
  SeedOptions& options = command->options;
  flags.Group("Input")
      .Require("predictions_path", &command->predictions_path, "Predictions folder")
      .Add("database_path",
           &command->database_path,
           "COLMAP database whose ids the model takes; without it ids follow the names")
      .Add("image_path", &options.image_folder, "The photos, to colour the points");
  flags.Group("Algorithm")
      .Add("shared_camera", &options.shared_camera, "One camera for all photos of a size")
      .Add("points", &options.with_points, "3D points from confident static depth")
      .Add("tracks",
           &command->with_tracks,
           "Instead, the database's verified matches as points, placed by depth")
      .Add("keep_percent",
           &options.keep_percent,
           "Share of depth pixels kept, by confidence over all views, percent")
      .Add("mask_threshold",
           &options.distractor_threshold,
           "Distractor probability from which a pixel gives no point, in (0,1]")
      .Add("voxel_size",
           &options.voxel_size,
           "Grid that merges points, as a share of the camera extent; 0 = none")
      .Add("max_relative_depth_difference",
           &options.max_relative_depth_difference,
           "Views see the same point if depths agree this well")
      .Add(
          "min_track_length", &options.min_track_length, "Points seen by fewer views are left out");
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Model folder to write")
      .AddChoice("output_type", &command->output_type, {"BIN", "TXT"}, "COLMAP's model format")
      .Add("ply_path", &command->ply_path, "Also write the points as PLY")
      .Add("pcd_path", &command->pcd_path, "Also write the points as PCD")
      .Add("overwrite", &command->overwrite, "Replace an existing model");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
