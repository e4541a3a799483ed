// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply.h"
#include "bridge/mask_files.h"
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "plugin/mask_flags.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <memory>

namespace vgtw {
namespace {

struct MaskMakeCommand {
  std::filesystem::path predictions_path;
  std::filesystem::path output_path;
  MaskFlags mask;
  bool overwrite = false;
  Usability usability;

  void Run() const {
    Apply(usability);
    const PredictionReader predictions(predictions_path);
    ProgressDisplay display("masks");
    const auto summaries = WriteMasks(predictions,
                                      output_path,
                                      mask.Options(),
                                      overwrite,
                                      usability.num_threads,
                                      display.Callback());
    std::vector<std::vector<std::string>> rows = {{"photo", "excluded %"}};
    nlohmann::json images = nlohmann::json::array();
    for (const MaskSummary& summary : summaries) {
      rows.push_back({summary.image_name, FormatNumber(100.0 * summary.excluded_share, 2)});
      images.push_back({{"name", summary.image_name}, {"excluded_share", summary.excluded_share}});
    }
    Finish(usability,
           FormatTable(rows) + "written: " + std::to_string(summaries.size()) + " masks in " +
               output_path.string() + "\n",
           {{"images", images}, {"output_path", output_path.string()}});
  }
};

struct MaskApplyCommand {
  std::filesystem::path database_path;
  std::filesystem::path mask_path;
  std::filesystem::path output_path;
  ApplyMasksOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    if (output_path.empty() && !options.in_place) {
      throw Error("no target, expected --output_path NEW.db or --in_place");
    }
    options.num_threads = usability.num_threads;
    ProgressDisplay display("mask apply");
    const ApplyMasksSummary summary =
        ApplyMasks(database_path, mask_path, output_path, options, display.Callback());
    Finish(usability, Text(summary), Json(summary));
  }

  std::string Text(const ApplyMasksSummary& summary) const {
    std::vector<std::vector<std::string>> rows = {{"photo", "keypoints", "excluded"}};
    for (const ApplyMasksImageSummary& image : summary.images) {
      rows.push_back({image.image_name,
                      std::to_string(image.num_keypoints),
                      image.has_mask ? std::to_string(image.num_excluded_keypoints) : "no mask"});
    }
    const auto change = [](const char* what, uint64_t before, uint64_t after) {
      return std::string(what) + ": " + std::to_string(before) + " -> " + std::to_string(after) +
             "\n";
    };
    return FormatTable(rows) +
           change("matches", summary.num_matches_before, summary.num_matches_after) +
           change("inlier matches",
                  summary.num_inlier_matches_before,
                  summary.num_inlier_matches_after) +
           "written: " + (options.in_place ? database_path : output_path).string() + "\n";
  }

  static nlohmann::json Json(const ApplyMasksSummary& summary) {
    nlohmann::json images = nlohmann::json::array();
    for (const ApplyMasksImageSummary& image : summary.images) {
      images.push_back({{"name", image.image_name},
                        {"has_mask", image.has_mask},
                        {"num_keypoints", image.num_keypoints},
                        {"num_excluded_keypoints", image.num_excluded_keypoints}});
    }
    return {{"images", images},
            {"num_matches_before", summary.num_matches_before},
            {"num_matches_after", summary.num_matches_after},
            {"num_inlier_matches_before", summary.num_inlier_matches_before},
            {"num_inlier_matches_after", summary.num_inlier_matches_after}};
  }
};

}  // namespace

std::function<void()> DeclareMaskMake(Flags& flags) {
  const auto command = std::make_shared<MaskMakeCommand>();
  flags.Group("Input").Require(
      "predictions_path", &command->predictions_path, "Predictions folder");
  command->mask.Declare(flags);
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Mask folder to write: <photo name>.png each")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

std::function<void()> DeclareMaskApply(Flags& flags) {
  const auto command = std::make_shared<MaskApplyCommand>();
  flags.Group("Input")
      .Require("database_path", &command->database_path, "COLMAP database, any version from 3.8")
      .Require("mask_path", &command->mask_path, "COLMAP masks: <photo name>.png, 0 = excluded")
      .Add("allow_missing_masks",
           &command->options.allow_missing_masks,
           "Keep everything in images without a mask instead of stopping");
  flags.Group("Output")
      .Add("output_path", &command->output_path, "Database to write")
      .Add("in_place", &command->options.in_place, "Change --database_path itself")
      .Add("overwrite", &command->options.overwrite, "Replace an existing output database");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
