// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions.h"
#include "plugin/commands.h"
#include "plugin/network_commands.h"
#include "plugin/network_flags.h"
#include "plugin/progress.h"
#include "plugin/subprocess.h"
#include "plugin/table.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/statistics.h"

#include <cmath>
#include <memory>
#include <numbers>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// One line of the table.
struct ViewRow {
  std::string name;
  double field_of_view_deg = 0.0;  // horizontal
  double near_depth = 0.0;         // 5 % of depths are nearer
  double far_depth = 0.0;          // 5 % are farther
  double distractor_percent = std::nan("");
};

ViewRow Describe(const ViewPrediction& prediction) {
  const Camera& camera = prediction.view.camera;
  ViewRow row;
  row.name = prediction.view.name;
  row.field_of_view_deg =
      360.0 / std::numbers::pi *
      std::atan(0.5 * static_cast<double>(camera.width) / camera.FocalLengthX());
  std::vector<double> depths;
  for (const float depth : prediction.depth.data()) {
    if (std::isfinite(depth)) depths.push_back(static_cast<double>(depth));
  }
  row.near_depth = Percentile(depths, 5.0);
  row.far_depth = Percentile(std::move(depths), 95.0);
  if (prediction.distractor.empty()) return row;
  int64_t num_known = 0;
  int64_t num_distractor = 0;
  for (const float probability : prediction.distractor.data()) {
    num_known += std::isfinite(probability);
    num_distractor += probability >= 0.5f;
  }
  row.distractor_percent =
      100.0 * static_cast<double>(num_distractor) / static_cast<double>(num_known);
  return row;
}

struct PredictCommand {
  NetworkFlags network_flags;
  fs::path output_path;
  std::string reference = "first";
  bool overwrite = false;
  Usability usability;

  void Run() {
    Apply(usability);
    // Fail before the work, not after it.
    AtomicFolder{output_path, overwrite};
    const std::vector<std::string> names = ListImages(network_flags.image_path);
    PredictOptions options = network_flags.Options(names, usability);
    if (reference == "most-connected") options.reference = ReferenceChoice::kMostConnected;
    Announce("reading the weights");
    const Predictor predictor(network_flags.weights.Files(), options);
    const std::string network(NetworkKindName(predictor.kind()));
    PredictionWriter writer(output_path, network, network_flags.weights.Hash(), overwrite);
    std::vector<ViewRow> rows;
    PredictSummary summary;
    {
      ProgressDisplay display("predict");
      const auto add = [&](const ViewPrediction& prediction) {
        writer.Add(prediction);
        rows.push_back(Describe(prediction));
      };
      summary = predictor.Run(network_flags.image_path, names, add, display.Callback());
    }
    if (rows.empty()) {
      throw Error("no view is usable (" + Printable(summary.rejected_views.front()) +
                  "); are these the weights of a trained network?");
    }
    writer.Commit();
    Finish(usability, Text(network, summary, rows), Json(network, summary, rows));
  }

  std::string Text(const std::string& network,
                   const PredictSummary& summary,
                   const std::vector<ViewRow>& rows) const {
    std::vector<std::vector<std::string>> table = {
        {"view", "fov (deg)", "depth 5 %", "depth 95 %", "distractors (%)"}};
    for (const ViewRow& row : rows) {
      table.push_back({row.name,
                       FormatNumber(row.field_of_view_deg, 1),
                       FormatNumber(row.near_depth, 3),
                       FormatNumber(row.far_depth, 3),
                       FormatNumber(row.distractor_percent, 1)});
    }
    std::string text = FormatTable(table) + "depths in scene units\n";
    for (const std::string& view : summary.rejected_views) {
      text += "warning: left out " + Printable(view) + "\n";
    }
    if (!summary.alignments.empty()) text += "\n" + AlignmentTable(summary.alignments);
    text += "\n" + network + ", " + std::to_string(summary.num_views) + " views at " +
            std::to_string(summary.network_width) + "x" + std::to_string(summary.network_height) +
            ": photos " + FormatNumber(summary.load_sec, 1) + " s, trunk and cameras " +
            FormatNumber(summary.encode_sec, 1) + " s, heads " +
            FormatNumber(summary.heads_sec, 1) + " s, peak memory " +
            FormatNumber(summary.peak_memory_gib, 2) + " GiB\n";
    return text + "written: " + output_path.string() + "\nNext: " +
           ShellLine("vgtw",
                     {"run",
                      "--image_path",
                      network_flags.image_path.string(),
                      "--predictions_path",
                      output_path.string(),
                      "--output_path",
                      "out/"}) +
           "\n";
  }

  static std::string AlignmentTable(const std::vector<ChunkAlignment>& alignments) {
    std::vector<std::vector<std::string>> table = {
        {"chunk", "views", "shared", "scale", "centres rmse", "rotation (deg)", "depth (%)"}};
    for (const ChunkAlignment& a : alignments) {
      const bool is_first = a.num_shared_views == 0;
      const auto residual = [&](double value, int digits) {
        return is_first ? std::string("-") : FormatNumber(value, digits);
      };
      table.push_back(
          {std::to_string(table.size()),
           std::to_string(a.first_view + 1) + "-" + std::to_string(a.first_view + a.num_views),
           std::to_string(a.num_shared_views),
           residual(a.scale, 4),
           residual(a.centre_rmse, 5),
           residual(a.rotation_median_deg, 3),
           residual(a.depth_median_percent, 2)});
    }
    return FormatTable(table) +
           "residuals of the shared views, Sim3-aligned; centres in scene units, others medians\n";
  }

  json Json(const std::string& network,
            const PredictSummary& summary,
            const std::vector<ViewRow>& rows) const {
    json views = json::array();
    for (const ViewRow& row : rows) {
      views.push_back({{"name", row.name},
                       {"field_of_view_deg", row.field_of_view_deg},
                       {"near_depth", row.near_depth},
                       {"far_depth", row.far_depth},
                       {"distractor_percent", row.distractor_percent}});
    }
    json alignments = json::array();
    for (const ChunkAlignment& a : summary.alignments) {
      alignments.push_back({{"first_view", a.first_view},
                            {"num_views", a.num_views},
                            {"num_shared_views", a.num_shared_views},
                            {"scale", a.scale},
                            {"centre_rmse", a.centre_rmse},
                            {"rotation_median_deg", a.rotation_median_deg},
                            {"depth_median_percent", a.depth_median_percent}});
    }
    return {{"network", network},
            {"network_width", summary.network_width},
            {"network_height", summary.network_height},
            {"views", views},
            {"rejected_views", summary.rejected_views},
            {"alignments", alignments},
            {"load_sec", summary.load_sec},
            {"encode_sec", summary.encode_sec},
            {"heads_sec", summary.heads_sec},
            {"peak_memory_gib", summary.peak_memory_gib},
            {"output_path", output_path.string()}};
  }
};

}  // namespace

std::function<void()> DeclarePredict(Flags& flags) {
  const auto command = std::make_shared<PredictCommand>();
  NetworkFlags& network_flags = command->network_flags;
  PredictOptions& options = network_flags.options();
  network_flags.DeclareInput(flags);
  network_flags.DeclareImageSize(flags);
  flags.Group("Algorithm")
      .AddChoice("reference",
                 &command->reference,
                 {"first", "most-connected"},
                 "View whose frame a chunk is predicted in (not pi3)")
      .Add("max_views",
           &options.max_views_at_once,
           "Views in one pass, at least 2; more become chunks that are aligned; 0 = as many as "
           "--max_memory allows")
      .Add("overlap",
           &options.num_overlap_views,
           "Views that chunks share, at most half of --max_views")
      .Add("points", &options.with_points, "Also write the points of the network's point head");
  network_flags.DeclareMachine(flags);
  flags.Group("Output")
      .Require("output_path", &command->output_path, "Predictions folder to write")
      .Add("overwrite", &command->overwrite, "Replace an existing folder");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
