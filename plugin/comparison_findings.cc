// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison_findings.h"

#include "plugin/table.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

using nlohmann::json;

// Relative changes that are worth a word.
constexpr double kWorseFactor = 1.1;
constexpr double kMinWorsePx = 0.05;
constexpr double kMinWorseDeg = 0.02;
constexpr int kFewObservations = 30;
constexpr double kMuchExcludedPercent = 60.0;

bool IsWorse(const json& before, const json& after, double min_difference) {
  if (!before.is_number() || !after.is_number()) return false;
  const double b = before, a = after;
  return a > kWorseFactor * b && a > b + min_difference;
}

std::string Change(const json& before, const json& after, int digits, const std::string& unit) {
  return "from " + FormatNumber(before, digits) + " to " + FormatNumber(after, digits) + " " + unit;
}

struct Guilt {
  double weight = 0.0;
  std::string why;

  void Add(double more, const std::string& reason) {
    weight += more;
    why += (why.empty() ? "" : "; ") + reason;
  }
};

Guilt GuiltOf(const json& view) {
  Guilt guilt;
  const json& before = view.at("by_model").front();
  const json& after = view.at("by_model").back();
  if (after.is_null()) {
    if (!before.is_null()) guilt.Add(8.0, "missing in the last model");
    return guilt;
  }
  if (after.at("status") == "rejected" || after.at("status") == "kept") {
    guilt.Add(after.at("status") == "rejected" ? 6.0 : 4.0,
              "keeps its pose: " + after.at("reason").get<std::string>());
  }
  if (!before.is_null()) {
    if (IsWorse(before.at("rotation_error_deg"), after.at("rotation_error_deg"), kMinWorseDeg)) {
      guilt.Add(
          5.0,
          "farther from the reference, rotation error " +
              Change(before.at("rotation_error_deg"), after.at("rotation_error_deg"), 3, "deg"));
    }
    if (IsWorse(before.at("held_out_px"), after.at("held_out_px"), kMinWorsePx)) {
      guilt.Add(3.0,
                "tracks held out fit worse, " +
                    Change(before.at("held_out_px"), after.at("held_out_px"), 2, "px"));
    }
  }
  const int num_observations = after.at("num_observations");
  if (num_observations < kFewObservations) {
    guilt.Add(2.0, "only " + std::to_string(num_observations) + " observations");
  }
  const json& on_distractors = after.at("observations_on_distractors");
  if (on_distractors.is_number() && 10 * on_distractors.get<int>() > num_observations) {
    guilt.Add(1.0, std::to_string(on_distractors.get<int>()) + " observations on distractors");
  }
  const json& excluded = view.at("excluded_percent");
  if (excluded.is_number() && excluded.get<double>() > kMuchExcludedPercent) {
    guilt.Add(1.0, "masks exclude " + FormatNumber(excluded, 0) + " %");
  }
  return guilt;
}

std::string Quoted(const json& model) { return "'" + model.at("name").get<std::string>() + "'"; }

// "better", "worse" or "alike" by one figure, where less is better.
std::string Verdict(const json& before, const json& after) {
  const double b = before, a = after;
  if (a < b / 1.02) return "better";
  return a > 1.02 * b ? "worse" : "alike";
}

std::string AgainstReference(const json& first, const json& last) {
  const json& before = first.at("pose_error");
  const json& after = last.at("pose_error");
  const std::string rotations =
      Verdict(before.at("rotation_median_deg"), after.at("rotation_median_deg"));
  const std::string centres =
      Verdict(before.at("centre_rmse_percent"), after.at("centre_rmse_percent"));
  std::string answer = " is neither closer to the reference nor farther from it than ";
  if (rotations != centres && rotations != "alike" && centres != "alike") {
    answer = rotations == "better"
                 ? " has better rotations, but worse centres against the reference than "
                 : " has better centres, but worse rotations against the reference than ";
  } else if (rotations == "better" || centres == "better") {
    answer = " is closer to the reference than ";
  } else if (rotations == "worse" || centres == "worse") {
    answer = " is farther from the reference than ";
  }
  return Quoted(last) + answer + Quoted(first) + ".";
}

std::string FiguresOfReference(const json& first, const json& last) {
  const json& before = first.at("pose_error");
  const json& after = last.at("pose_error");
  return "Rotation errors went " +
         Change(before.at("rotation_median_deg"), after.at("rotation_median_deg"), 3, "deg") +
         " (median over pairs), those of centres " +
         Change(before.at("centre_rmse_percent"), after.at("centre_rmse_percent"), 3, "%") +
         " of the extent (RMSE, Sim3-aligned), " +
         std::to_string(after.at("num_views").get<int>()) + " photos.";
}

std::string ByHeldOut(const json& first, const json& last) {
  const json& before = first.at("held_out_px");
  const json& after = last.at("held_out_px");
  const std::string verdict = Verdict(before, after);
  const std::string answer = verdict == "better"  ? " explains tracks held out better than "
                             : verdict == "worse" ? " explains tracks held out worse than "
                                                  : " explains tracks held out as well as ";
  return Quoted(last) + answer + Quoted(first) + ".";
}

std::string FiguresOfHeldOut(const json& first, const json& last) {
  return "The error of tracks held out of refinement went " +
         Change(first.at("held_out_px"), last.at("held_out_px"), 3, "px") + " (robust mean).";
}

std::string Size(const json& model) {
  return Quoted(model) + ": " + std::to_string(model.at("num_images").get<size_t>()) + " photos, " +
         std::to_string(model.at("num_points3D").get<size_t>()) + " points, " +
         std::to_string(model.at("num_observations").get<size_t>()) +
         " observations, median error " + FormatNumber(model.at("median_px"), 2) + " px.";
}

// "18 of 20 photos were refined, 1 kept its pose, 1 was rejected."
std::string Outcomes(const json& views) {
  size_t num_refined = 0, num_kept = 0, num_rejected = 0, num = 0;
  for (const json& view : views) {
    const json& last = view.at("by_model").back();
    if (last.is_null() || last.at("status").is_null()) continue;
    ++num;
    num_refined += last.at("status") == "refined";
    num_kept += last.at("status") == "kept";
    num_rejected += last.at("status") == "rejected";
  }
  if (num == 0) return "";
  std::string text =
      std::to_string(num_refined) + " of " + std::to_string(num) + " photos have a refined pose";
  if (num_kept > 0) text += ", " + std::to_string(num_kept) + " kept theirs for want of evidence";
  if (num_rejected > 0) {
    text += ", for " + std::to_string(num_rejected) + " a new pose was found and not believed";
  }
  return text + ".";
}

}  // namespace

json FindGuiltyViews(const json& comparison) {
  std::vector<std::pair<double, json>> guilty;
  for (const json& view : comparison.at("views")) {
    const Guilt guilt = GuiltOf(view);
    if (guilt.why.empty()) continue;
    guilty.push_back({guilt.weight, {{"name", view.at("name")}, {"why", guilt.why}}});
  }
  std::stable_sort(
      guilty.begin(), guilty.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  json names = json::array();
  for (auto& [weight, entry] : guilty) names.push_back(std::move(entry));
  return names;
}

json Summarise(const json& comparison) {
  const json& models = comparison.at("models");
  const json& first = models.front();
  const json& last = models.back();
  json sentences = json::array();
  if (models.size() > 1) {
    const bool has_reference =
        !first.at("pose_error").is_null() && !last.at("pose_error").is_null();
    const bool has_held_out =
        !first.at("held_out_px").is_null() && !last.at("held_out_px").is_null();
    if (has_reference) {
      sentences.push_back(AgainstReference(first, last));
      sentences.push_back(FiguresOfReference(first, last));
    } else if (has_held_out) {
      sentences.push_back(ByHeldOut(first, last));
    }
    if (has_held_out) sentences.push_back(FiguresOfHeldOut(first, last));
  }
  const std::string outcomes = Outcomes(comparison.at("views"));
  if (!outcomes.empty()) sentences.push_back(outcomes);
  for (const json& model : models) sentences.push_back(Size(model));
  if (const size_t num = comparison.at("guilty").size(); num > 0) {
    sentences.push_back(std::to_string(num) + (num == 1 ? " photo deserves" : " photos deserve") +
                        " a look, " +
                        comparison.at("guilty").front().at("name").get<std::string>() + " first.");
  }
  return sentences;
}

}  // namespace vgtw
