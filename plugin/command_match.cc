// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/new_database.h"
#include "bridge/seed.h"
#include "plugin/commands.h"
#include "plugin/feature_stage.h"
#include "plugin/match_flags.h"
#include "plugin/match_stage.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <memory>
#include <optional>

namespace vgtw {
namespace {

struct MatchCommand {
  std::filesystem::path predictions_path;
  std::filesystem::path database_path;
  FeatureStageOptions features;
  SeedOptions cameras;
  std::filesystem::path output_path;
  MatchFlags match_flags;
  bool in_place = false;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    CheckTargets();
    const PredictionReader predictions(predictions_path);
    MatchStageOptions options;
    match_flags.ApplyTo(features.extract.sift, options);
    options.num_threads = features.extract.num_threads = usability.num_threads;
    MatchStageSummary summary;
    if (in_place) {
      ColmapDatabase database(database_path, ColmapDatabase::Mode::kReadWrite);
      summary = MatchDatabase(predictions, options, database);
    } else {
      std::optional<NewDatabase> target;
      if (database_path.empty()) {
        target.emplace(output_path, overwrite);
        WriteSeedCameras(predictions, features.image_path, cameras, target->database());
        ExtractDatabaseFeatures(features, target->database());
      } else {
        target.emplace(output_path, overwrite, database_path);
      }
      summary = MatchDatabase(predictions, options, target->database());
      target->Commit();
    }
    Finish(usability, Text(summary), AsJson(summary));
  }

  void CheckTargets() const {
    if (database_path.empty() == features.image_path.empty()) {
      throw Error(
          "expected either --image_path, to make features, or --database_path, which has them");
    }
    if (!database_path.empty() && !features.mask_path.empty()) {
      throw Error(
          "--mask_path is for new features, expected --image_path; 'vgtw mask apply' masks those "
          "of a database");
    }
    if (output_path.empty() == !in_place) {
      throw Error("expected one target, --output_path NEW.db or --in_place");
    }
    if (in_place && database_path.empty()) {
      throw Error("--in_place changes --database_path, which is missing");
    }
  }

  std::string Text(const MatchStageSummary& summary) const {
    std::vector<std::vector<std::string>> rows = {
        {"photo", "features", "pairs", "matches", "prediction off by, deg"}};
    for (const MatchedImage& image : summary.images) {
      rows.push_back(
          {image.name,
           std::to_string(image.num_keypoints),
           std::to_string(image.num_pairs),
           std::to_string(image.num_inlier_matches),
           image.prediction_error_deg ? FormatNumber(*image.prediction_error_deg, 2) : "-"});
    }
    std::string text = FormatTable(rows);
    text += std::to_string(summary.num_pairs) +
            " pairs are co-visible: " + std::to_string(summary.num_guided) +
            " matched as predicted, " + std::to_string(summary.num_widened) +
            " in wider windows, " + std::to_string(summary.num_unguided) +
            " without the prediction, " + std::to_string(summary.num_unmatched) + " not at all\n";
    for (const std::string& name : summary.without_predictions) {
      text += "note: " + name + " has no prediction and no matches\n";
    }
    return text + "written: " + (in_place ? database_path : output_path).string() + "\n";
  }
};

}  // namespace

std::function<void()> DeclareMatch(Flags& flags) {
  const auto command = std::make_shared<MatchCommand>();
  command->cameras.camera_model = CameraModel::kSimpleRadial;
  flags.Group("Input")
      .Require("predictions_path",
               &command->predictions_path,
               "Predictions folder (from 'vgtw predict' or 'vgtw import')")
      .Add("image_path", &command->features.image_path, "The photos, for a new database")
      .Add("mask_path",
           &command->features.mask_path,
           "COLMAP masks: <photo name>.png, 0 = no features there")
      .Add("database_path",
           &command->database_path,
           "Instead of photos: a COLMAP database whose features are matched anew");
  command->match_flags.Declare(flags);
  flags.Group("Cameras of a new database")
      .Add("shared_camera", &command->cameras.shared_camera, "One camera for all photos of a size");
  flags.Group("Output")
      .Add("output_path", &command->output_path, "Database to write")
      .Add("in_place", &command->in_place, "Change --database_path itself")
      .Add("overwrite", &command->overwrite, "Replace an existing output");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
