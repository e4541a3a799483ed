// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/pipeline.h"
#include "plugin/report.h"
#include "plugin/run_flags.h"

#include <memory>

namespace vgtw {
namespace {

struct RunCommand {
  PipelineOptions options;
  RunFlags run_flags;
  Usability usability;

  void Run() {
    Apply(usability);
    run_flags.ApplyTo(options);
    options.num_threads = usability.num_threads;
    const PipelineReport report = RunPipeline(options);
    Finish(usability,
           FormatReport(report) + "written: " + options.output_path.string() +
               " (database.db, masks/, sparse/feedforward, sparse/refined, points.ply, run.json, "
               "report.html)\n",
           AsJson(report));
  }
};

}  // namespace

std::function<void()> DeclareRun(Flags& flags) {
  const auto command = std::make_shared<RunCommand>();
  PipelineOptions& options = command->options;
  flags.Group("Input")
      .Require("image_path", &options.image_path, "The photos")
      .Require("predictions_path",
               &options.predictions_path,
               "Predictions folder (from 'vgtw predict' or 'vgtw import')")
      .Add("mask_path",
           &options.mask_path,
           "COLMAP masks made elsewhere, instead of the predicted distractors")
      .Add("use_masks", &options.use_masks, "0 = mask nothing, for comparison")
      .Add("reference_path",
           &options.reference_path,
           "Better poses by image name, to compare with: COLMAP model, predictions, "
           "transforms.json, TUM trajectory");
  command->run_flags.Declare(flags);
  flags.Group("Output")
      .Require(
          "output_path", &options.output_path, "Workspace; stages that are up to date are kept")
      .Add("overwrite", &options.overwrite, "Replace stages made from other inputs or options")
      .Add("force", &options.force, "Repeat every stage");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
