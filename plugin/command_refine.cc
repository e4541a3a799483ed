// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_database.h"
#include "bridge/colmap_model.h"
#include "bridge/point_cloud.h"
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "plugin/database_tracks.h"
#include "plugin/progress.h"
#include "plugin/refine_flags.h"
#include "plugin/refine_priors.h"
#include "plugin/refine_report.h"
#include "scene/error.h"
#include "scene/point_colors.h"

#include <memory>
#include <optional>

namespace vgtw {
namespace {

struct RefineCommand {
  std::filesystem::path input_path;
  std::filesystem::path database_path;
  std::filesystem::path predictions_path;
  std::filesystem::path image_path;
  std::filesystem::path output_path;
  std::filesystem::path ply_path;
  std::string output_type = "BIN";
  RefineFlags refine_flags;
  ExpectedErrors errors;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    WriteModelOptions write;
    write.format = output_type == "TXT" ? ModelFormat::kText : ModelFormat::kBinary;
    write.overwrite = overwrite;
    Reconstruction seed = ReadModel(input_path);
    std::optional<ColmapDatabase> database;
    if (!database_path.empty()) {
      database.emplace(database_path, ColmapDatabase::Mode::kReadOnly);
    }
    const std::vector<Track> tracks = FindTracks(database, seed);
    const BundlePriors priors = FindPriors(database, seed, tracks);
    RefineModelResult result = Refine(seed, tracks, priors);
    WriteModel(result.refined, output_path, write);
    if (!ply_path.empty()) WritePly(ply_path, PointsOf(result.refined));
    Finish(usability,
           FormatRefinement(result) + "written: " + output_path.string() + "\n",
           AsJson(result));
  }

  std::vector<Track> FindTracks(const std::optional<ColmapDatabase>& database,
                                Reconstruction& seed) const {
    if (!database) {
      if (seed.points3D.empty()) {
        Fail(input_path,
             "the model has no points to refine with",
             "points, or --database_path with matches");
      }
      return TracksOf(seed);
    }
    return ReadTracks(*database, seed);
  }

  BundlePriors FindPriors(const std::optional<ColmapDatabase>& database,
                          const Reconstruction& seed,
                          const std::vector<Track>& tracks) const {
    PriorOptions options = refine_flags.priors();
    options.errors = errors;
    options.num_threads = usability.num_threads;
    std::optional<PredictionReader> predictions;
    if (!predictions_path.empty()) predictions.emplace(predictions_path);
    return MakePriors(options,
                      predictions ? &*predictions : nullptr,
                      database ? &*database : nullptr,
                      seed,
                      tracks);
  }

  RefineModelResult Refine(const Reconstruction& seed,
                           const std::vector<Track>& tracks,
                           const BundlePriors& priors) const {
    RefineModelOptions options;
    refine_flags.ApplyTo(options);
    options.priors = priors;
    options.num_threads = usability.num_threads;
    RefineModelResult result;
    {
      ProgressDisplay display("refine");
      options.progress = display.Callback();
      result = RefineModel(options, seed, tracks);
    }
    if (!image_path.empty()) {
      ProgressDisplay display("colours");
      ColorPoints(image_path, result.refined, usability.num_threads, display.Callback());
    }
    return result;
  }
};

}  // namespace

std::function<void()> DeclareRefine(Flags& flags) {
  const auto command = std::make_shared<RefineCommand>();
  flags.Group("Input")
      .Require("input_path", &command->input_path, "COLMAP model whose poses to refine")
      .Add("database_path",
           &command->database_path,
           "COLMAP database of the same ids, whose verified matches are triangulated; without it "
           "the model's own tracks are")
      .Add("predictions_path",
           &command->predictions_path,
           "Predictions folder of images of the same names, for priors")
      .Add("image_path", &command->image_path, "The photos, to colour the points");
  command->refine_flags.Declare(flags);
  AddExpectedErrors(flags, command->errors);
  flags.Group("Output")
      .Require("output_path", &command->output_path, "New folder for the refined model")
      .AddChoice("output_type", &command->output_type, {"BIN", "TXT"}, "Format of the model")
      .Add("ply_path", &command->ply_path, "Also the points as PLY")
      .Add("overwrite", &command->overwrite, "Replace an existing output");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
