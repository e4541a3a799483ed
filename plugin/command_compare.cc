// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/colmap_model.h"
#include "bridge/pose_files.h"
#include "plugin/commands.h"
#include "plugin/comparison.h"
#include "plugin/comparison_pictures.h"
#include "plugin/comparison_text.h"
#include "plugin/progress.h"
#include "plugin/workspace.h"
#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <memory>
#include <set>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// The shortest ends of the paths that tell them apart.
std::vector<std::string> NamesOf(const std::vector<fs::path>& paths) {
  std::vector<fs::path> rests;
  std::vector<std::string> names;
  for (const fs::path& path : paths) {
    const fs::path whole = fs::absolute(path).lexically_normal();
    rests.push_back(whole.has_filename() ? whole : whole.parent_path());
    names.push_back("");
  }
  for (size_t depth = 0; depth < 8; ++depth) {
    for (size_t i = 0; i < paths.size(); ++i) {
      const std::string part = rests[i].filename().string();
      names[i] = names[i].empty() ? part : part + "/" + names[i];
      rests[i] = rests[i].parent_path();
    }
    if (std::set<std::string>(names.begin(), names.end()).size() == names.size()) return names;
  }
  Fail(paths.front(), "is named twice", "different models");
}

struct CompareCommand {
  std::vector<fs::path> model_paths;
  ComparisonInputs inputs;
  fs::path output_path;
  fs::path csv_path;
  fs::path markdown_path;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    for (const fs::path& path : {output_path, csv_path, markdown_path}) CheckTarget(path);
    inputs.num_threads = usability.num_threads;
    ReadInputs();
    nlohmann::json comparison;
    {
      ProgressDisplay display("compare");
      comparison = CompareModels(inputs, display.Callback());
    }
    if (!csv_path.empty()) WriteFileAtomically(csv_path, ComparisonAsCsv(comparison));
    if (!markdown_path.empty()) {
      WriteFileAtomically(markdown_path, ComparisonAsMarkdown(comparison));
    }
    if (!output_path.empty()) WriteComparisonPage(output_path, inputs, comparison);
    Finish(usability,
           FormatComparison(comparison) +
               (output_path.empty() ? "" : "written: " + output_path.string() + "\n"),
           comparison);
  }

  void CheckTarget(const fs::path& path) const {
    if (path.empty()) return;
    if (!overwrite && fs::exists(path)) {
      Fail(path, "exists", "a new file", "name another or add --overwrite");
    }
    AtomicFile{path};
  }

  void ReadInputs() {
    const std::vector<std::string> names = NamesOf(model_paths);
    for (size_t i = 0; i < model_paths.size(); ++i) {
      inputs.models.push_back({names[i], model_paths[i], ReadModel(model_paths[i])});
      if (inputs.models.back().model.images.empty()) {
        Fail(model_paths[i], "the model has no images", "some");
      }
    }
    if (!inputs.reference_path.empty()) inputs.reference = ReadPoses(inputs.reference_path);
    UseRunRecord(RunRecordOf(model_paths.back()), inputs);
    inputs.command = "vgtw compare";
    for (const fs::path& path : model_paths) inputs.command += " " + path.string();
    for (const std::string& name : names) {
      inputs.title += (inputs.title.empty() ? "" : " against ") + name;
    }
  }
};

}  // namespace

std::function<void()> DeclareCompare(Flags& flags) {
  const auto command = std::make_shared<CompareCommand>();
  ComparisonInputs& inputs = command->inputs;
  flags.Group("Input")
      .Positional("models",
                  &command->model_paths,
                  1,
                  "COLMAP models of the same photos; changes are measured against the first")
      .Add("reference_path",
           &inputs.reference_path,
           "COLMAP model or predictions with better poses, to measure errors against")
      .Add("database_path",
           &inputs.database_path,
           "The models' database: tracks of it that refinement holds out judge all models")
      .Add("mask_path", &inputs.mask_path, "COLMAP masks, to count points on distractors")
      .Add("image_path", &inputs.image_path, "The photos, for pictures in the report");
  flags.Group("Tracks held out")
      .Add("held_out_percent", &inputs.held_out_percent, "Share of the tracks, percent")
      .Add("held_out_seed", &inputs.held_out_seed, "Of their random choice")
      .Add("held_out_max_px", &inputs.held_out_max_px, "Errors beyond count alike, pixels");
  flags.Group("Output")
      .Add("output_path", &command->output_path, "The report, one HTML file")
      .Add("csv_path", &command->csv_path, "Figures of every model and photo as CSV")
      .Add("markdown_path", &command->markdown_path, "Tables as Markdown")
      .Add("max_num_points", &inputs.max_num_points, "Of each model in the report's 3D view")
      .Add("overwrite", &command->overwrite, "Replace existing files");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
