// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_apply.h"
#include "plugin/commands.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <memory>

namespace vgtw {
namespace {

std::string Change(const char* what, uint64_t before, uint64_t after) {
  return std::string(what) + ": " + std::to_string(before) + " -> " + std::to_string(after) + "\n";
}

struct MaskApplyCommand {
  std::filesystem::path database_path;
  std::filesystem::path mask_path;
  std::filesystem::path output_path;
  std::string rule = "matches";
  ApplyMasksOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    if (output_path.empty() && !options.in_place) {
      throw Error("no target, expected --output_path NEW.db or --in_place");
    }
    if (!output_path.empty() && options.in_place) {
      throw Error("two targets, expected one of --output_path and --in_place");
    }
    if (options.model_path.empty() != options.model_output_path.empty()) {
      throw Error("half of a model, expected both --input_path and --model_output_path");
    }
    options.rule = rule == "keypoints" ? MaskRule::kKeypoints
                   : rule == "tracks"  ? MaskRule::kTracks
                                       : MaskRule::kMatches;
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
    std::string text = FormatTable(rows);
    if (options.rule == MaskRule::kTracks) {
      text += "kept keypoints in tracks with excluded ones: " +
              std::to_string(summary.num_linked_keypoints) + "\n";
    }
    text +=
        Change("matches", summary.num_matches_before, summary.num_matches_after) +
        Change(
            "inlier matches", summary.num_inlier_matches_before, summary.num_inlier_matches_after) +
        Change(
            "pairs with a geometry", summary.num_geometries_before, summary.num_geometries_after);
    if (!summary.disconnected_images.empty()) {
      text += "images without a geometry now:";
      for (const std::string& name : summary.disconnected_images) text += " " + name;
      text += "\n";
    }
    if (summary.model) text += ModelText(*summary.model);
    const std::string target = (options.in_place ? database_path : output_path).string();
    text += "written: " + target + "\n";
    if (options.keep_undo) text += "undo: vgtw mask restore --database_path " + target + "\n";
    return text;
  }

  std::string ModelText(const ApplyMasksModelSummary& model) const {
    return Change("points of the model", model.num_points3D_before, model.num_points3D_after) +
           Change("observations", model.num_observations_before, model.num_observations_after) +
           "written: " + options.model_output_path.string() +
           " (mask restore does not change models back: keep " + options.model_path.string() +
           ")\n";
  }

  nlohmann::json Json(const ApplyMasksSummary& summary) const {
    nlohmann::json images = nlohmann::json::array();
    for (const ApplyMasksImageSummary& image : summary.images) {
      images.push_back({{"name", image.image_name},
                        {"has_mask", image.has_mask},
                        {"num_keypoints", image.num_keypoints},
                        {"num_excluded_keypoints", image.num_excluded_keypoints}});
    }
    nlohmann::json json = {{"rule", rule},
                           {"images", images},
                           {"num_linked_keypoints", summary.num_linked_keypoints},
                           {"num_matches_before", summary.num_matches_before},
                           {"num_matches_after", summary.num_matches_after},
                           {"num_inlier_matches_before", summary.num_inlier_matches_before},
                           {"num_inlier_matches_after", summary.num_inlier_matches_after},
                           {"num_geometries_before", summary.num_geometries_before},
                           {"num_geometries_after", summary.num_geometries_after},
                           {"disconnected_images", summary.disconnected_images}};
    if (summary.model) {
      json["model"] = {{"num_points3D_before", summary.model->num_points3D_before},
                       {"num_points3D_after", summary.model->num_points3D_after},
                       {"num_observations_before", summary.model->num_observations_before},
                       {"num_observations_after", summary.model->num_observations_after}};
    }
    return json;
  }
};

void DeclareRules(Flags& flags, MaskApplyCommand& command) {
  flags.Group("Algorithm")
      .AddChoice("rule",
                 &command.rule,
                 {"matches", "keypoints", "tracks"},
                 "What goes: matches of excluded keypoints (indices stay valid); the keypoints "
                 "themselves (everything renumbered); matches of their whole tracks")
      .Add("dilate_px",
           &command.options.dilate_px,
           "Also exclude keypoints up to this many pixels from a distractor")
      .Add("dilate_scale",
           &command.options.dilate_scale,
           "Add this many times the keypoint's scale to --dilate_px")
      .Add("min_num_inliers",
           &command.options.min_num_inliers,
           "Empty geometries that lost inlier matches and keep fewer; 15 as COLMAP's verification "
           "and mapper");
}

}  // namespace

std::function<void()> DeclareMaskApply(Flags& flags) {
  const auto command = std::make_shared<MaskApplyCommand>();
  flags.Group("Input")
      .Require("database_path", &command->database_path, "COLMAP database, any version from 3.8")
      .Require("mask_path", &command->mask_path, "COLMAP masks: <photo name>.png, 0 = excluded")
      .Add("allow_missing_masks",
           &command->options.allow_missing_masks,
           "Keep everything in images without a mask instead of stopping")
      .Add("input_path",
           &command->options.model_path,
           "Sparse model made from this database, to take distractors out of it, too");
  DeclareRules(flags, *command);
  flags.Group("Output")
      .Add("output_path", &command->output_path, "Database to write")
      .Add("in_place", &command->options.in_place, "Change --database_path itself")
      .Add("model_output_path",
           &command->options.model_output_path,
           "Folder to write the model of --input_path to, in its format")
      .Add("undo",
           &command->options.keep_undo,
           "Keep originals of changed rows in the database, for mask restore")
      .Add("overwrite", &command->options.overwrite, "Replace an existing output");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
