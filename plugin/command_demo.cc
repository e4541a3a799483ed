// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/demo.h"
#include "plugin/report.h"
#include "plugin/run_flags.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <algorithm>
#include <memory>

namespace vgtw {
namespace {

std::string NumRefined(const PipelineReport& report) {
  const auto num =
      std::count_if(report.views.begin(), report.views.end(), [](const ViewReport& view) {
        return view.outcome == Name(ViewOutcome::kRefined);
      });
  return std::to_string(num) + "/" + std::to_string(report.views.size());
}

struct DemoCommand {
  DemoOptions options;
  RunFlags run_flags;
  std::filesystem::path weights_path;
  std::filesystem::path lora_path;
  std::string path = "orbit";
  uint64_t seed = 0;
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    const auto& out = options.output_path;
    if (std::filesystem::exists(out) && !std::filesystem::is_empty(out) && !overwrite) {
      Fail(out, "exists", "a new or empty folder", "name another or add --overwrite");
    }
    if (path == "forward") options.scene.path = CameraPath::kForward;
    if (path == "grid") options.scene.path = CameraPath::kGrid;
    if (!weights_path.empty()) options.weights = {weights_path};
    if (!lora_path.empty()) {
      if (weights_path.empty()) {
        throw Error("--lora_path without --weights_path, expected the weights that it belongs to");
      }
      options.weights.push_back(lora_path);
    }
    options.scene.seed = seed;
    options.perturb.seed = seed;
    options.scene.num_threads = usability.num_threads;
    run_flags.ApplyTo(options.pipeline);
    options.pipeline.num_threads = usability.num_threads;
    options.pipeline.overwrite = overwrite;
    const DemoReport report = RunDemo(options);
    Finish(usability, Text(report), Json(report));
  }

  std::string Text(const DemoReport& report) const {
    const auto row = [](const char* what, const std::string& without, const std::string& with) {
      return std::vector<std::string>{what, without, with};
    };
    const auto& without = report.without_masks;
    const auto& with = report.with_masks;
    const auto centre = [](const std::optional<PoseComparison>& error) {
      return error ? FormatNumber(error->centre_rmse_percent, 3) : "-";
    };
    const auto rotation = [](const std::optional<PoseComparison>& error) {
      return error ? FormatNumber(error->relative_rotation_median_deg, 3) : "-";
    };
    return FormatTable(
               {{"refined model", "without masks", "with masks"},
                row("registered photos", NumRefined(without.report), NumRefined(with.report)),
                row("points",
                    std::to_string(without.report.refined.num_points3D),
                    std::to_string(with.report.refined.num_points3D)),
                row("points on distractors",
                    std::to_string(without.on_distractors.num_points3D),
                    std::to_string(with.on_distractors.num_points3D)),
                row("median reprojection error, px",
                    FormatNumber(without.report.refined.median_px, 3),
                    FormatNumber(with.report.refined.median_px, 3)),
                row("centre error, % of extent",
                    centre(without.report.refined_error),
                    centre(with.report.refined_error)),
                row("  of the feed-forward poses",
                    centre(without.report.feedforward_error),
                    centre(with.report.feedforward_error)),
                row("relative rotation error, deg",
                    rotation(without.report.refined_error),
                    rotation(with.report.refined_error)),
                row("  of the feed-forward poses",
                    rotation(without.report.feedforward_error),
                    rotation(with.report.feedforward_error))}) +
           "Predicted masks: IoU " + FormatNumber(report.mask_pixels.IoU(), 3) + ", precision " +
           FormatNumber(report.mask_pixels.Precision(), 3) + ", recall " +
           FormatNumber(report.mask_pixels.Recall(), 3) +
           "\nAgainst exact truth: centres RMSE after Sim3 alignment, rotations median over "
           "pairs.\n" +
           NextCommands();
  }

  std::string NextCommands() const {
    const std::string out = options.output_path.string();
    return "\nLook at:  " + out + "/report.html (what the masks bought)\n          " + out +
           "/with_masks/report.html (what refinement bought)\n          " + out +
           "/contact_sheet.png\n" +
           "Next:\n"
           "  colmap gui --import_path " +
           out + "/with_masks/sparse/refined --database_path " + out +
           "/with_masks/database.db --image_path " + out +
           "/photos\n"
           "  vgtw import --input_path vggt/sparse --image_path photos/ --output_path "
           "predictions/\n"
           "  vgtw run --image_path photos/ --predictions_path predictions/ --output_path out/\n"
           "  vgtw mask apply --database_path yours.db --mask_path masks/ --output_path "
           "masked.db\n";
  }

  static nlohmann::json Json(const DemoReport& report) {
    const auto run_as_json = [](const DemoRun& run) {
      nlohmann::json object = AsJson(run.report);
      object["points_on_distractors"] = run.on_distractors.num_points3D;
      object["observations_on_distractors"] = run.on_distractors.num_observations;
      return object;
    };
    return {{"with_masks", run_as_json(report.with_masks)},
            {"without_masks", run_as_json(report.without_masks)},
            {"predicted_masks",
             {{"iou", report.mask_pixels.IoU()},
              {"precision", report.mask_pixels.Precision()},
              {"recall", report.mask_pixels.Recall()}}}};
  }
};

}  // namespace

std::function<void()> DeclareDemo(Flags& flags) {
  const auto command = std::make_shared<DemoCommand>();
  SyntheticOptions& scene = command->options.scene;
  PerturbOptions& perturb = command->options.perturb;
  perturb.mask_edge_px = 1.0;
  flags.Group("Scene")
      .AddChoice(
          "camera_path", &command->path, {"orbit", "forward", "grid"}, "How the camera moves")
      .Add("num_views", &scene.num_views, "Photos to render")
      .Add("width", &scene.width, "Photo width, pixels")
      .Add("height", &scene.height, "Photo height, pixels")
      .Add("num_distractors", &scene.num_distractors, "Movers in the scene")
      .Add("distractor_size", &scene.distractor_size, "Scales their extent")
      .Add("image_noise", &scene.image_noise, "Sigma of noise, grey levels of 255")
      .Add("exposure_change", &scene.exposure_change, "Sigma of the log gain per photo")
      .Add("seed", &command->seed, "Seed of scene and prediction errors");
  flags.Group("Network")
      .Add("weights_path",
           &command->weights_path,
           "Weights that look at the photos; none = the truth with errors is the prediction")
      .Add("lora_path", &command->lora_path, "LoRA and distractor head over these weights");
  flags.Group("Errors of the feed-forward prediction, without a network")
      .Add("rotation_deg", &perturb.rotation_deg, "Sigma of rotations, degrees")
      .Add("centre_percent", &perturb.centre_percent, "Camera centres, % of the camera extent")
      .Add("focal_percent", &perturb.focal_percent, "Sigma of focal lengths, %")
      .Add("mask_flip_percent", &perturb.mask_flip_percent, "Share of distractors missed, %")
      .Add("mask_edge_px", &perturb.mask_edge_px, "Sigma of mask edges, network pixels");
  command->run_flags.Declare(flags);
  flags.Group("Output")
      .Require("output_path", &command->options.output_path, "Folder to write")
      .Add("overwrite", &command->overwrite, "Write into an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
