// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/training_folders.h"
#include "plugin/commands.h"
#include "plugin/json_number.h"
#include "plugin/lint_text.h"
#include "plugin/progress.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <cmath>
#include <memory>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// What a table calls a scene that has no folder of its own.
std::string NameOf(const TrainingScene& scene) { return scene.name.empty() ? "." : scene.name; }

std::string Percent(double share) { return FormatNumber(100.0 * share, 2); }

struct DatasetFolders {
  fs::path image_path;
  fs::path mask_path;

  void Declare(Flags& flags) {
    flags.Group("Input")
        .Require("image_path", &image_path, "Photos of one scene, or a folder of them for each")
        .Require("mask_path",
                 &mask_path,
                 "Their masks, <photo name>.png, 0 = distractor; folders alike");
  }
  std::vector<TrainingScene> Scenes() const { return FindTrainingScenes(image_path, mask_path); }
};

struct DatasetCheckCommand {
  DatasetFolders folders;
  TrainingFolderOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    std::vector<SceneCheck> checks;
    {
      ProgressDisplay display("dataset check");
      checks = CheckTrainingScenes(folders.Scenes(), options, display.Callback());
    }
    Finish(usability, Text(checks), Json(checks));
    const size_t num_errors = Count(checks, LintSeverity::kError);
    if (num_errors == 0) return;
    throw Error(Plural(num_errors, "error") + " in " + folders.image_path.string() +
                ", expected scenes that can be trained on (see the report)");
  }

 private:
  static size_t Count(const std::vector<SceneCheck>& checks, LintSeverity severity) {
    size_t count = 0;
    for (const SceneCheck& check : checks) count += check.Count(severity);
    return count;
  }

  static std::string Text(const std::vector<SceneCheck>& checks) {
    std::vector<std::vector<std::string>> rows = {
        {"scene", "photos", "masks", "distractor %", "errors", "warnings"}};
    for (const SceneCheck& check : checks) {
      rows.push_back({NameOf(check.scene),
                      std::to_string(check.num_photos),
                      std::to_string(check.num_masks),
                      Percent(check.distractor_share),
                      std::to_string(check.Count(LintSeverity::kError)),
                      std::to_string(check.Count(LintSeverity::kWarning))});
    }
    const size_t num_errors = Count(checks, LintSeverity::kError);
    return FormatTable(rows) + FindingsText(TrainingRules(), Findings(checks)) +
           Plural(checks.size(), "scene") + ": " +
           (num_errors == 0 ? "can be trained on, " : Plural(num_errors, "error") + ", ") +
           Plural(Count(checks, LintSeverity::kWarning), "warning") + "\n";
  }

  // Named by scene, as the rules of all scenes are told together.
  static std::vector<LintFinding> Findings(const std::vector<SceneCheck>& checks) {
    std::vector<LintFinding> findings;
    for (const SceneCheck& check : checks) {
      for (LintFinding finding : check.findings) {
        finding.name = NameOf(check.scene) + (finding.name.empty() ? "" : "/" + finding.name);
        findings.push_back(std::move(finding));
      }
    }
    return findings;
  }

  static json Json(const std::vector<SceneCheck>& checks) {
    json scenes = json::array();
    for (const SceneCheck& check : checks) {
      scenes.push_back({{"name", check.scene.name},
                        {"num_photos", check.num_photos},
                        {"num_masks", check.num_masks},
                        {"distractor_share", NumberOrNull(check.distractor_share)},
                        {"findings", FindingsJson(check.findings)}});
    }
    return {{"scenes", scenes},
            {"num_errors", Count(checks, LintSeverity::kError)},
            {"num_warnings", Count(checks, LintSeverity::kWarning)},
            {"is_trainable", Count(checks, LintSeverity::kError) == 0}};
  }
};

struct DatasetStatsCommand {
  DatasetFolders folders;
  TrainingFolderOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    TrainingFolderStats stats;
    {
      ProgressDisplay display("dataset stats");
      stats = ComputeTrainingStats(folders.Scenes(), options, display.Callback());
    }
    std::vector<std::vector<std::string>> rows = {{"scene",
                                                   "photos",
                                                   "views",
                                                   "sizes (px)",
                                                   "distractor %",
                                                   "min %",
                                                   "max %",
                                                   "without",
                                                   "patches distractor %",
                                                   "static %",
                                                   "mixed %"}};
    json scenes = json::array();
    for (const SceneStats& scene : stats.scenes) {
      rows.push_back(Row(NameOf(scene.scene), scene.stats));
      scenes.push_back(Json(scene.stats));
      scenes.back()["name"] = scene.scene.name;
    }
    rows.push_back(Row("all", stats.total));
    Finish(usability,
           FormatTable(rows) +
               "views: photos with a mask of their size; without: views without a distractor; "
               "patches of 14 x 14 px at " +
               std::to_string(options.width) + " x " + std::to_string(options.height) +
               ": distractor > 50 %, static < 10 %\n",
           {{"scenes", scenes},
            {"total", Json(stats.total)},
            {"width", options.width},
            {"height", options.height}});
  }

 private:
  static std::string SizesText(const TrainingStats& stats) {
    if (stats.sizes.empty()) return "-";
    const ImageSize& size = stats.sizes.front().first;
    return std::to_string(size.width) + " x " + std::to_string(size.height) +
           (stats.sizes.size() > 1 ? " +" + std::to_string(stats.sizes.size() - 1) : "");
  }

  static double PatchShare(const TrainingStats& stats, uint64_t count) {
    const uint64_t num_patches =
        stats.num_distractor_patches + stats.num_static_patches + stats.num_mixed_patches;
    if (num_patches == 0) return std::nan("");
    return static_cast<double>(count) / static_cast<double>(num_patches);
  }

  static std::vector<std::string> Row(const std::string& name, const TrainingStats& stats) {
    return {name,
            std::to_string(stats.num_photos),
            std::to_string(stats.num_views),
            SizesText(stats),
            Percent(stats.mean_share),
            Percent(stats.min_share),
            Percent(stats.max_share),
            std::to_string(stats.num_without_distractor),
            Percent(PatchShare(stats, stats.num_distractor_patches)),
            Percent(PatchShare(stats, stats.num_static_patches)),
            Percent(PatchShare(stats, stats.num_mixed_patches))};
  }

  static json Json(const TrainingStats& stats) {
    json sizes = json::array();
    for (const auto& [size, count] : stats.sizes) {
      sizes.push_back({{"width", size.width}, {"height", size.height}, {"num_views", count}});
    }
    return {{"num_photos", stats.num_photos},
            {"num_views", stats.num_views},
            {"sizes", sizes},
            {"mean_distractor_share", NumberOrNull(stats.mean_share)},
            {"min_distractor_share", NumberOrNull(stats.min_share)},
            {"max_distractor_share", NumberOrNull(stats.max_share)},
            {"num_without_distractor", stats.num_without_distractor},
            {"num_distractor_patches", stats.num_distractor_patches},
            {"num_static_patches", stats.num_static_patches},
            {"num_mixed_patches", stats.num_mixed_patches}};
  }
};

struct DatasetCorruptCommand {
  DatasetFolders folders;
  fs::path output_path;
  CorruptMasksOptions options;
  Usability usability;

  void Run() {
    Apply(usability);
    options.num_threads = usability.num_threads;
    CorruptedMasks corrupted;
    {
      ProgressDisplay display("dataset corrupt");
      corrupted = CorruptMasks(
          folders.image_path, folders.mask_path, output_path, options, display.Callback());
    }
    std::string text;
    for (const std::string& name : corrupted.names) text += name + "\n";
    Finish(usability,
           text + "all static now: " + std::to_string(corrupted.names.size()) + " of " +
               std::to_string(corrupted.num_with_distractor) +
               " masks that held a distractor (of " + Plural(corrupted.num_masks, "mask") +
               ")\nwritten: " + output_path.string() + "\n",
           {{"corrupted", corrupted.names},
            {"num_masks", corrupted.num_masks},
            {"num_with_distractor", corrupted.num_with_distractor},
            {"share", options.share},
            {"seed", options.seed},
            {"output_path", output_path.string()}});
  }
};

template <typename Command>
std::function<void()> DeclareAtNetworkSize(Flags& flags) {
  const auto command = std::make_shared<Command>();
  command->folders.Declare(flags);
  flags.Group("Network")
      .Add("width", &command->options.width, "Of the network's images, pixels, a multiple of 14")
      .Add("height", &command->options.height, "Likewise");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace

std::function<void()> DeclareDatasetCheck(Flags& flags) {
  return DeclareAtNetworkSize<DatasetCheckCommand>(flags);
}

std::function<void()> DeclareDatasetStats(Flags& flags) {
  return DeclareAtNetworkSize<DatasetStatsCommand>(flags);
}

std::function<void()> DeclareDatasetCorrupt(Flags& flags) {
  const auto command = std::make_shared<DatasetCorruptCommand>();
  command->folders.Declare(flags);
  flags.Group("Algorithm")
      .Add("share",
           &command->options.share,
           "Share of the masks that hold a distractor which become all static, in [0,1]; the paper "
           "takes 0.1")
      .Add("seed", &command->options.seed, "Of the choice");
  flags.Group("Output")
      .Require("output_path",
               &command->output_path,
               "Mask folder to write, with corrupted.json that names what was changed")
      .Add("overwrite", &command->options.overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
