// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"
#include "plugin/pose_evaluation.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <algorithm>
#include <map>
#include <memory>

namespace vgtw {
namespace {

using nlohmann::json;

const std::map<std::string, PoseAlignment> kAlignments = {{"first", PoseAlignment::kFirstCamera},
                                                          {"none", PoseAlignment::kNone},
                                                          {"se3", PoseAlignment::kSE3},
                                                          {"sim3", PoseAlignment::kSim3}};

std::string InUnits(double value) { return FormatNumber(value, 6) + " scene units"; }

std::string Count(size_t number, const char* what) { return std::to_string(number) + " " + what; }

// "a, b, c and 4 more".
std::string SomeOf(const std::vector<std::string>& names) {
  constexpr size_t kMaxNames = 10;
  std::string text;
  for (size_t i = 0; i < std::min(kMaxNames, names.size()); ++i) {
    text += (i == 0 ? "" : ", ") + Printable(names[i]);
  }
  return names.size() > kMaxNames
             ? text + " and " + std::to_string(names.size() - kMaxNames) + " more"
             : text;
}

json AsJson(const ErrorStatistics& statistics) {
  return {{"rmse", statistics.rmse},
          {"mean", statistics.mean},
          {"median", statistics.median},
          {"max", statistics.max}};
}

struct EvaluatePoseCommand {
  PoseEvaluationOptions options;
  std::string alignment = "sim3";
  Usability usability;

  void Run() {
    Apply(usability);
    CheckFlags();
    options.alignment.type = kAlignments.at(alignment);
    const PoseEvaluation evaluation = EvaluatePoses(options);
    Finish(usability, Text(evaluation), Json(evaluation));
  }

  void CheckFlags() const {
    options.rpe.Check();
    if (!(options.max_time_difference_sec >= 0.0)) {
      throw Error("--max_time_difference_sec is negative");
    }
    if (options.alignment.robust && alignment != "se3" && alignment != "sim3") {
      throw Error("--robust with --alignment " + alignment +
                  ", expected an alignment that is estimated: sim3 or se3");
    }
    for (const int64_t threshold_deg : options.auc_deg) {
      if (threshold_deg < 1 || threshold_deg > 180) {
        throw Error("--auc " + std::to_string(threshold_deg) + ", expected degrees from 1 to 180");
      }
    }
  }

  std::string Text(const PoseEvaluation& evaluation) const {
    return ViewTable(evaluation) + "\n" + Summary(evaluation) + "\n" + PairTable(evaluation) +
           Remarks(evaluation);
  }

  std::string ViewTable(const PoseEvaluation& evaluation) const {
    std::vector<std::vector<std::string>> rows = {
        {"view", "centre", "rotation deg", "relative deg"}};
    if (options.alignment.robust) rows[0].push_back("aligned on");
    for (const ViewPoseError& view : evaluation.comparison.views) {
      rows.push_back({Printable(view.name),
                      FormatNumber(view.centre, 6),
                      FormatNumber(view.rotation_deg, 4),
                      FormatNumber(view.relative_rotation_deg, 4)});
      if (options.alignment.robust) rows.back().push_back(view.is_inlier ? "yes" : "no");
    }
    return FormatTable(rows) + "centre: distance in scene units of the reference, and rotation: " +
           AlignmentText(evaluation.comparison.alignment) +
           "; relative: median rotation to the other views, not aligned\n";
  }

  static std::string Views(const PoseEvaluation& evaluation) {
    const PoseComparison& comparison = evaluation.comparison;
    std::string text = AlignmentText(comparison.alignment);
    if (comparison.alignment.robust) {
      text += " on " +
              std::to_string(std::count_if(comparison.views.begin(),
                                           comparison.views.end(),
                                           [](const auto& view) { return view.is_inlier; })) +
              " of them";
    }
    return text + ", " + std::to_string(comparison.views.size()) + " of " +
           Count(evaluation.num_reference, "views");
  }

  std::string Summary(const PoseEvaluation& evaluation) const {
    const PoseComparison& comparison = evaluation.comparison;
    const std::string views = Views(evaluation);
    std::string text = "ATE " + InUnits(evaluation.ate.rmse) + " = " +
                       FormatNumber(comparison.centre_rmse_percent, 4) +
                       " % of the extent (RMSE of centres), " + views + "\n";
    text += "    mean " + FormatNumber(evaluation.ate.mean, 6) + ", median " +
            FormatNumber(evaluation.ate.median, 6) + ", max " +
            FormatNumber(evaluation.ate.max, 6) + " scene units\n";
    text += "rotations " + FormatNumber(comparison.rotation_mean_deg, 4) + " deg (mean), " +
            FormatNumber(comparison.rotation_median_deg, 4) + " deg (median), " + views + "\n";
    text += RpeLine(evaluation);
    text += "relative rotations " + FormatNumber(comparison.relative_rotation_median_deg, 4) +
            " deg, directions " + FormatNumber(comparison.relative_direction_median_deg, 4) +
            " deg (medians), not aligned, " + Count(comparison.pairs.size(), "pairs") + "\n";
    text += "scale " + FormatNumber(comparison.reference_from_estimate.scale, 6) +
            " of the reference to the estimate; extent of the reference " +
            InUnits(comparison.extent) + "\n";
    return text;
  }

  std::string RpeLine(const PoseEvaluation& evaluation) const {
    const std::string pairs = "delta " + std::to_string(options.rpe.delta) + " in the order of " +
                              evaluation.order + (options.rpe.all_pairs ? "" : ", not overlapping");
    if (!evaluation.rpe) return "RPE: no pair of views (" + pairs + ")\n";
    return "RPE " + InUnits(evaluation.rpe->translation.rmse) + ", " +
           FormatNumber(evaluation.rpe->rotation_deg.rmse, 4) + " deg (RMSE; " + pairs + ", " +
           Count(evaluation.rpe->num_pairs, "pairs") + "), translations " +
           AlignmentText(evaluation.comparison.alignment) + "\n";
  }

  static std::string PairTable(const PoseEvaluation& evaluation) {
    std::vector<std::vector<std::string>> rows = {
        {"below", "RRA", "RTA", "AUC histogram (VGGT)", "AUC trapezoid (COLMAP)"}};
    for (const PairAccuracy& accuracy : evaluation.accuracies) {
      rows.push_back({FormatNumber(accuracy.threshold_deg, 0) + " deg",
                      FormatNumber(accuracy.rotation, 4),
                      FormatNumber(accuracy.direction, 4),
                      FormatNumber(accuracy.auc_histogram, 4),
                      FormatNumber(accuracy.auc_trapezoid, 4)});
    }
    return FormatTable(rows) + "shares of " +
           Count(evaluation.comparison.pairs.size() + evaluation.num_wrong_pairs, "pairs") +
           ", not aligned" +
           (evaluation.num_wrong_pairs == 0
                ? ""
                : "; " + Count(evaluation.num_wrong_pairs, "of missing views count as wrong")) +
           "\n";
  }

  static std::string Remarks(const PoseEvaluation& evaluation) {
    std::string text;
    const std::vector<std::string>& missing = evaluation.comparison.missing;
    if (!missing.empty()) {
      text += "missing in the estimate (" + std::to_string(missing.size()) +
              "): " + SomeOf(missing) + "\n";
    }
    if (evaluation.num_surplus > 0) {
      text += "note: " + Count(evaluation.num_surplus, "poses of the estimate have no reference\n");
    }
    for (const std::string& note : evaluation.notes) text += "note: " + note + "\n";
    for (const std::string& warning : evaluation.warnings) text += "warning: " + warning + "\n";
    return text;
  }

  json Json(const PoseEvaluation& evaluation) const {
    const PoseComparison& comparison = evaluation.comparison;
    json views = json::array();
    for (const ViewPoseError& view : comparison.views) {
      views.push_back({{"name", Printable(view.name)},
                       {"centre", view.centre},
                       {"rotation_deg", view.rotation_deg},
                       {"relative_rotation_deg", view.relative_rotation_deg},
                       {"is_inlier", view.is_inlier}});
    }
    json missing = json::array();
    for (const std::string& name : comparison.missing) missing.push_back(Printable(name));
    json object = {{"alignment", AlignmentText(comparison.alignment)},
                   {"scale", comparison.reference_from_estimate.scale},
                   {"num_views", comparison.views.size()},
                   {"num_reference", evaluation.num_reference},
                   {"num_surplus", evaluation.num_surplus},
                   {"missing", missing},
                   {"extent", comparison.extent},
                   {"ate", AsJson(evaluation.ate)},
                   {"ate_percent_of_extent", comparison.centre_rmse_percent},
                   {"rotation_mean_deg", comparison.rotation_mean_deg},
                   {"rotation_median_deg", comparison.rotation_median_deg},
                   {"relative_rotation_median_deg", comparison.relative_rotation_median_deg},
                   {"relative_direction_median_deg", comparison.relative_direction_median_deg},
                   {"accuracy", AccuracyJson(evaluation)},
                   {"views", views},
                   {"notes", evaluation.notes},
                   {"warnings", evaluation.warnings}};
    if (evaluation.rpe) {
      object["rpe"] = {{"delta", options.rpe.delta},
                       {"all_pairs", options.rpe.all_pairs},
                       {"order", evaluation.order},
                       {"num_pairs", evaluation.rpe->num_pairs},
                       {"translation", AsJson(evaluation.rpe->translation)},
                       {"rotation_deg", AsJson(evaluation.rpe->rotation_deg)}};
    }
    return object;
  }

  static json AccuracyJson(const PoseEvaluation& evaluation) {
    json rows = json::array();
    for (const PairAccuracy& accuracy : evaluation.accuracies) {
      rows.push_back({{"threshold_deg", accuracy.threshold_deg},
                      {"rra", accuracy.rotation},
                      {"rta", accuracy.direction},
                      {"auc_histogram", accuracy.auc_histogram},
                      {"auc_trapezoid", accuracy.auc_trapezoid}});
    }
    return {{"num_pairs", evaluation.comparison.pairs.size()},
            {"num_pairs_of_missing_views", evaluation.num_wrong_pairs},
            {"thresholds", rows}};
  }
};

}  // namespace

std::function<void()> DeclareEvaluatePose(Flags& flags) {
  const auto command = std::make_shared<EvaluatePoseCommand>();
  PoseEvaluationOptions& options = command->options;
  flags.Group("Input")
      .Require(
          "input_path",
          &options.input_path,
          "Poses to judge: COLMAP model, predictions, transforms.json, TUM or KITTI trajectory")
      .Require("reference_path", &options.reference_path, "Better poses, in any of these forms")
      .Add("max_time_difference_sec",
           &options.max_time_difference_sec,
           "Of poses that belong together, seconds; where both are trajectories with timestamps");
  flags.Group("Repairs of convention mistakes")
      .Add("invert_poses",
           &options.repair.invert_poses,
           "--input_path holds the opposite of what its format prescribes")
      .Add("opengl_axes",
           &options.repair.opengl_axes,
           "Its cameras look along -z with y up (of transforms.json: they do not)")
      .Add("swap_quaternion_order",
           &options.repair.swap_quaternion_order,
           "Its quaternions have their scalar at the other end");
  flags.Group("Algorithm")
      .AddChoice("alignment",
                 &command->alignment,
                 {"sim3", "se3", "first", "none"},
                 "sim3, se3 = best similarity or rigid motion of the camera centres; first = the "
                 "first camera becomes exact, scale stays")
      .Add("robust",
           &options.alignment.robust,
           "Align on the views that agree (least median of squares); all count in the figures")
      .Add("rpe_delta",
           &options.rpe.delta,
           "Step from the first to the second view of a pair of the RPE, at least 1")
      .Add("rpe_all_pairs", &options.rpe.all_pairs, "0 = only every delta-th pair, end to end")
      .Add("auc", &options.auc_deg, "Thresholds of RRA, RTA and AUC, degrees: 3,5,10,30")
      .Add("count_missing",
           &options.count_missing,
           "Pairs of views that the estimate lacks count as wrong in RRA, RTA and AUC");
  AddUsability(flags, command->usability);
  return [command] { command->Run(); };
}

}  // namespace vgtw
