// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/report.h"

#include "bridge/colmap_model.h"
#include "bridge/pose_files.h"
#include "plugin/refine_report.h"
#include "plugin/table.h"

#include <algorithm>

namespace vgtw {
namespace {

using nlohmann::json;

std::vector<ViewReport> ReportViews(const json& stages,
                                    const Reconstruction& feedforward,
                                    const Reconstruction& refined) {
  std::map<std::string, double> change_deg_by_name;
  if (const auto change =
          ComparePoses(CamFromWorldByName(refined), CamFromWorldByName(feedforward))) {
    for (const auto& view : change->views)
      change_deg_by_name[view.name] = view.relative_rotation_deg;
  }
  const json& features = stages.at("features").at("result").at("views");
  std::vector<ViewReport> views;
  for (const auto& [id, image] : refined.images) {
    ViewReport view;
    view.name = image.name;
    if (const auto found = features.find(image.name); found != features.end()) {
      view.num_keypoints = found->at("num_keypoints");
      view.num_excluded_keypoints = found->at("num_excluded_keypoints");
    }
    if (stages.contains("masks")) {
      const json& shares = stages.at("masks").at("result").at("excluded_share");
      view.excluded_share = shares.value(image.name, 0.0);
    }
    view.rotation_change_deg = change_deg_by_name[image.name];
    const json& refinement = stages.at("refine").at("result").at("views").at(image.name);
    view.num_observations = refinement.at("num_observations");
    view.num_supporting = refinement.at("num_supporting_observations");
    view.outcome = refinement.at("outcome");
    view.reason = refinement.at("reason");
    views.push_back(view);
  }
  std::sort(views.begin(), views.end(), [](const ViewReport& a, const ViewReport& b) {
    return a.name < b.name;
  });
  return views;
}

std::string PoseLine(const char* label, const PoseComparison& error) {
  return std::string(label) + ": centres " + FormatNumber(error.centre_rmse_percent, 3) +
         " % of extent (RMSE, Sim3-aligned), rotations " +
         FormatNumber(error.relative_rotation_median_deg, 3) + " deg, directions " +
         FormatNumber(error.relative_direction_median_deg, 3) +
         " deg (medians over pairs, not aligned), " + std::to_string(error.views.size()) +
         " views\n";
}

std::vector<std::string> StatsRow(const char* label, const ReprojectionStats& stats) {
  return {label,
          std::to_string(stats.num_images),
          std::to_string(stats.num_points3D),
          std::to_string(stats.num_observations),
          FormatNumber(stats.mean_track_length, 2),
          FormatNumber(stats.median_px, 3),
          FormatNumber(stats.p90_px, 3)};
}

}  // namespace

json OptionsAsJson(const PipelineOptions& options) {
  return {{"mask",
           {{"use_masks", options.use_masks},
            {"threshold", options.mask.threshold},
            {"dilate_px", options.mask.dilate_px},
            {"erode_px", options.mask.erode_px},
            {"min_area_px", options.mask.min_area_px},
            {"fill_holes_px", options.mask.fill_holes_px},
            {"unknown", options.mask.unknown == UnknownPolicy::kKeep ? "keep" : "exclude"}}},
          {"features",
           {{"extractor", options.matcher == Matcher::kGuided ? "vgtw" : "colmap"},
            {"max_num_features", options.sift.max_num_features},
            {"max_image_size", options.sift.max_image_size},
            {"mask_margin_scales", options.sift.mask_margin_scales},
            {"use_gpu", options.use_gpu},
            {"camera_model", GetCameraModelInfo(options.camera_model).name},
            {"shared_camera", options.shared_camera}}},
          {"matches",
           {{"matcher", Name(options.matcher)},
            {"num_best", options.match.pairs.num_best},
            {"num_diverse", options.match.pairs.num_diverse},
            {"rotation_deg", options.match.views.pair.uncertainty.rotation_deg},
            {"centre_percent", options.match.centre_percent},
            {"focal", options.match.views.pair.uncertainty.focal},
            {"depth", options.match.views.pair.uncertainty.depth},
            {"sequential_overlap", options.sequential_overlap}}},
          {"refine", AsJson(options.refine)},
          {"priors", AsJson(options.priors)}};
}

json AsJson(const ReprojectionStats& stats) {
  return {{"num_images", stats.num_images},
          {"num_points3D", stats.num_points3D},
          {"num_observations", stats.num_observations},
          {"num_behind_camera", stats.num_behind_camera},
          {"median_px", stats.median_px},
          {"mean_px", stats.mean_px},
          {"p90_px", stats.p90_px},
          {"mean_track_length", stats.mean_track_length}};
}

json AsJson(const PoseComparison& comparison) {
  json views = json::array();
  for (const ViewPoseError& view : comparison.views) {
    views.push_back({{"name", view.name},
                     {"rotation_deg", view.rotation_deg},
                     {"relative_rotation_deg", view.relative_rotation_deg},
                     {"centre", view.centre}});
  }
  return {{"alignment", "Sim3 on camera centres"},
          {"num_missing", comparison.missing.size()},
          {"extent", comparison.extent},
          {"centre_rmse", comparison.centre_rmse},
          {"centre_rmse_percent", comparison.centre_rmse_percent},
          {"rotation_mean_deg", comparison.rotation_mean_deg},
          {"rotation_median_deg", comparison.rotation_median_deg},
          {"relative_rotation_median_deg", comparison.relative_rotation_median_deg},
          {"relative_direction_median_deg", comparison.relative_direction_median_deg},
          {"views", views}};
}

json AsJson(const PipelineReport& report) {
  json views = json::array();
  for (const ViewReport& view : report.views) {
    views.push_back({{"name", view.name},
                     {"num_keypoints", view.num_keypoints},
                     {"num_excluded_keypoints", view.num_excluded_keypoints},
                     {"excluded_share", view.excluded_share},
                     {"num_observations", view.num_observations},
                     {"num_supporting_observations", view.num_supporting},
                     {"rotation_change_deg", view.rotation_change_deg},
                     {"status", view.outcome},
                     {"reason", view.reason}});
  }
  json object = {{"views", views},
                 {"feedforward", AsJson(report.feedforward)},
                 {"refined", AsJson(report.refined)},
                 {"num_verified_pairs", report.num_matched_pairs},
                 {"notes", report.notes}};
  if (report.feedforward_error) object["feedforward_error"] = AsJson(*report.feedforward_error);
  if (report.refined_error) object["refined_error"] = AsJson(*report.refined_error);
  return object;
}

ComparisonInputs ReadRun(const Workspace& workspace, const PipelineOptions& options) {
  ComparisonInputs run;
  run.models = {{"feed-forward", workspace.feedforward(), ReadModel(workspace.feedforward())},
                {"refined", workspace.refined(), ReadModel(workspace.refined())}};
  run.reference_path = options.reference_path;
  if (!options.reference_path.empty()) run.reference = ReadPoses(options.reference_path);
  run.image_path = options.image_path;
  if (options.use_masks) run.mask_path = workspace.masks();
  run.database_path = workspace.database();
  UseRunRecord(workspace.record(), run);
  run.title = options.output_path.string();
  run.command = "vgtw run";
  run.num_threads = options.num_threads;
  return run;
}

PipelineReport MakeReport(const Workspace& workspace, const ComparisonInputs& run) {
  const Reconstruction& feedforward = run.models.front().model;
  const Reconstruction& refined = run.models.back().model;
  PipelineReport report;
  const json& stages = workspace.record().at("stages");
  report.views = ReportViews(stages, feedforward, refined);
  report.feedforward = ComputeReprojectionStats(feedforward);
  report.refined = ComputeReprojectionStats(refined);
  report.num_matched_pairs = stages.at("matches").at("result").at("num_verified_pairs");
  if (run.reference_path.empty()) return report;
  report.feedforward_error = ComparePoses(CamFromWorldByName(feedforward), run.reference);
  report.refined_error = ComparePoses(CamFromWorldByName(refined), run.reference);
  if (!report.refined_error) {
    report.notes.push_back("the reference shares fewer than 3 views in general position");
  }
  return report;
}

std::string FormatReport(const PipelineReport& report) {
  std::vector<std::vector<std::string>> views = {{"photo",
                                                  "excluded %",
                                                  "keypoints",
                                                  "in mask",
                                                  "observations",
                                                  "supporting",
                                                  "turned deg",
                                                  "status"}};
  for (const ViewReport& view : report.views) {
    views.push_back({view.name,
                     FormatNumber(100.0 * view.excluded_share, 1),
                     std::to_string(view.num_keypoints),
                     std::to_string(view.num_excluded_keypoints),
                     std::to_string(view.num_observations),
                     std::to_string(view.num_supporting),
                     FormatNumber(view.rotation_change_deg, 3),
                     view.outcome});
  }
  std::string text = FormatTable(views) + "\n";
  text +=
      FormatTable({{"model", "images", "points", "observations", "track", "median px", "p90 px"},
                   StatsRow("feed-forward", report.feedforward),
                   StatsRow("refined", report.refined)});
  if (report.feedforward_error && report.refined_error) {
    text += "\nAgainst the reference\n";
    text += PoseLine("  feed-forward", *report.feedforward_error);
    text += PoseLine("  refined     ", *report.refined_error);
  }
  for (const std::string& note : report.notes) text += "note: " + note + "\n";
  return text;
}

}  // namespace vgtw
