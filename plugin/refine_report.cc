// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/refine_report.h"

#include "plugin/json_number.h"
#include "plugin/table.h"

#include <algorithm>
#include <map>

namespace vgtw {
namespace {

using nlohmann::json;

constexpr size_t kMaxNames = 5;

json AsJson(const RefinedView& view) {
  return {{"outcome", Name(view.outcome)},
          {"reason", view.reason},
          {"num_observations", view.num_observations},
          {"num_supporting_observations", view.num_supporting},
          {"num_held_out", view.num_held_out},
          {"held_out_before_px", NumberOrNull(view.held_out_before_px)},
          {"held_out_after_px", NumberOrNull(view.held_out_after_px)},
          {"sigma_rotation_deg", NumberOrNull(view.sigma_rotation_deg)},
          {"sigma_centre", NumberOrNull(view.sigma_centre)},
          {"turn_deg", view.turn_deg},
          {"move", view.move}};
}

// Groups of priors that took part, or why they did not.
json AsJson(const BundlePriorsSummary& priors) {
  json groups = json::object();
  const auto add = [&](const char* name, const PriorGroupSummary& group) {
    if (group.num_priors == 0 && group.message.empty()) return;
    groups[name] = {{"num_priors", group.num_priors},
                    {"rms_sigmas", NumberOrNull(group.final_rms)},
                    {"message", group.message}};
  };
  add("rotations", priors.rotations);
  add("pose_centres", priors.pose_centres);
  add("centres", priors.centres);
  add("focal_lengths", priors.focal_lengths);
  add("depths", priors.depths);
  return groups;
}

json AsJson(const RefineRound& round) {
  return {{"max_error_px", round.max_error_px},
          {"num_points3D", round.num_points3D},
          {"median_px", round.median_px},
          {"held_out_px", NumberOrNull(round.held_out_px)},
          {"is_accepted", round.is_accepted},
          {"put_back", round.put_back},
          {"adjustment", AsJson(round.adjustment)}};
}

json AsJson(const Uncertainty& uncertainty) {
  json cameras = json::object();
  for (const auto& [id, sigmas] : uncertainty.camera_sigmas) {
    json& camera = cameras[std::to_string(id)] = json::array();
    for (const double sigma : sigmas) camera.push_back(NumberOrNull(sigma));
  }
  return {{"success", uncertainty.success},
          {"message", uncertainty.message},
          {"gauge", uncertainty.gauge},
          {"sigma_px", NumberOrNull(uncertainty.sigma_px)},
          {"camera_sigmas", cameras}};
}

// "a.jpg, b.jpg and 7 others"
std::string JoinNames(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < std::min(names.size(), kMaxNames); ++i) {
    text += (i > 0 ? ", " : "") + names[i];
  }
  if (names.size() > kMaxNames) {
    text += " and " + std::to_string(names.size() - kMaxNames) + " others";
  }
  return text;
}

std::string Conclusion(const RefineModelResult& result) {
  if (!result.IsRefined()) {
    return "nothing was refined: poses and intrinsics are the seed's\n";
  }
  return "error of the " + std::to_string(result.num_held_out_tracks) + " tracks held out: from " +
         FormatNumber(result.held_out_before_px, 3) + " to " +
         FormatNumber(result.held_out_after_px, 3) + " px\n";
}

}  // namespace

json AsJson(const BundleAdjustmentSummary& summary) {
  return {{"success", summary.success},
          {"message", summary.message},
          {"num_residuals", summary.num_residuals},
          {"initial_cost", summary.initial_cost},
          {"final_cost", summary.final_cost},
          {"num_iterations", summary.num_iterations},
          {"gauge", summary.gauge},
          {"priors", AsJson(summary.priors)}};
}

json AsJson(const RefineModelOptions& options) {
  return {{"num_rounds", options.max_num_rounds},
          {"held_out_percent", options.held_out_percent},
          {"seed", options.seed},
          {"min_num_observations", options.min_num_observations},
          {"max_turn_deg", options.max_turn_deg},
          {"max_error_px", options.max_error_px},
          {"min_angle_deg", options.min_angle_deg},
          {"max_seconds", NumberOrNull(options.max_seconds)},
          {"refine_focal_length", options.refine_focal_length},
          {"refine_principal_point", options.refine_principal_point},
          {"refine_extra_params", options.refine_extra_params}};
}

json AsJson(const RefineModelResult& result) {
  json views = json::object();
  for (const auto& [id, view] : result.views) views[view.name] = AsJson(view);
  json rounds = json::array();
  for (const RefineRound& round : result.rounds) rounds.push_back(AsJson(round));
  return {{"views", views},
          {"rounds", rounds},
          {"is_out_of_time", result.is_out_of_time},
          {"num_held_out_tracks", result.num_held_out_tracks},
          {"held_out_max_px", result.held_out_max_px},
          {"held_out_before_px", NumberOrNull(result.held_out_before_px)},
          {"held_out_after_px", NumberOrNull(result.held_out_after_px)},
          {"uncertainty", AsJson(result.uncertainty)}};
}

std::vector<std::string> UnrefinedNotes(const json& views) {
  std::map<std::string, std::vector<std::string>> names_by_reason;
  for (const auto& [name, view] : views.items()) {
    const std::string reason = view.at("reason");
    if (!reason.empty()) names_by_reason[reason].push_back(name);
  }
  std::vector<std::string> notes;
  for (const auto& [reason, names] : names_by_reason) {
    notes.push_back(JoinNames(names) +
                    (names.size() == 1 ? " keeps its pose: " : " keep their poses: ") + reason);
  }
  return notes;
}

std::string FormatRefinement(const RefineModelResult& result) {
  std::vector<std::vector<std::string>> rows = {{"photo",
                                                 "observations",
                                                 "supporting",
                                                 "held out px before",
                                                 "after",
                                                 "turned deg",
                                                 "+- deg",
                                                 "status"}};
  for (const auto& [id, view] : result.views) {
    rows.push_back({view.name,
                    std::to_string(view.num_observations),
                    std::to_string(view.num_supporting),
                    FormatNumber(view.held_out_before_px, 2),
                    FormatNumber(view.held_out_after_px, 2),
                    FormatNumber(view.turn_deg, 3),
                    FormatNumber(view.sigma_rotation_deg, 3),
                    std::string(Name(view.outcome))});
  }
  std::string text = FormatTable(rows) + Conclusion(result);
  for (const std::string& note : UnrefinedNotes(AsJson(result).at("views"))) {
    text += "note: " + note + "\n";
  }
  if (result.is_out_of_time) text += "note: stopped by --max_seconds; more time may refine more\n";
  return text;
}

}  // namespace vgtw
