// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/pose_evaluation.h"

#include "bridge/pose_files.h"
#include "bridge/pose_matching.h"
#include "bridge/pose_readings.h"
#include "evaluation/pose_conventions.h"
#include "plugin/table.h"
#include "scene/error.h"

#include <algorithm>
#include <utility>

namespace vgtw {
namespace {

std::string ErrorsText(double error_deg, double error_as_read_deg) {
  return "agree with the reference to " + FormatNumber(error_deg, 2) + " deg instead of " +
         FormatNumber(error_as_read_deg, 2) + " deg (median of pairs, not aligned)";
}

std::optional<std::string> WarnOfReading(const std::vector<NamedPose>& estimate,
                                         const ConventionRepair& as_read,
                                         const std::vector<NamedPose>& reference) {
  const std::vector<PoseReading> readings = OtherReadings(estimate, as_read);
  std::vector<std::vector<NamedPose>> poses;
  for (const PoseReading& reading : readings) poses.push_back(reading.poses);
  const auto better = FindBetterReading(estimate, poses, reference);
  if (!better) return std::nullopt;
  const std::string& options = readings[better->idx].options;
  const std::string how = options.empty() ? "without the repairs asked for" : "with " + options;
  return "the poses break a convention: read " + how + " they " +
         ErrorsText(better->error_deg, better->error_as_read_deg) +
         (options.empty() ? "" : "; `vgtw import` mends them with that");
}

std::optional<std::string> WarnOfNames(const std::vector<NamedPose>& estimate,
                                       const std::vector<NamedPose>& reference) {
  constexpr size_t kMaxExamples = 3;
  const auto shuffled = FindShuffledNames(estimate, reference);
  if (!shuffled) return std::nullopt;
  std::string examples;
  for (size_t i = 0; i < std::min(kMaxExamples, shuffled->exchanges.size()); ++i) {
    const ShuffledNames::Exchange& exchange = shuffled->exchanges[i];
    examples +=
        (i == 0 ? "" : ", ") + Printable(exchange.name) + " is " + Printable(exchange.name_of_pose);
  }
  return "the names of " + std::to_string(shuffled->exchanges.size()) +
         " poses seem to be shuffled: they " +
         ErrorsText(shuffled->error_deg, shuffled->error_as_read_deg) + " if " + examples +
         " ...; rename the photos to the network's order and import again";
}

}  // namespace

PoseEvaluation EvaluatePoses(const PoseEvaluationOptions& options) {
  const PoseSet reference = ReadPoseSet(options.reference_path);
  const PoseSet estimate = ReadPoseSet(options.input_path, options.repair);
  MatchedPoses matched = MatchPoses(estimate, reference, options.max_time_difference_sec);
  auto comparison = ComparePoses(matched.estimate, reference.poses, options.alignment);
  if (!comparison) {
    Fail(options.input_path,
         "shares " + std::to_string(matched.estimate.size()) + " views with the reference",
         "at least 2, and 3 whose centres are not on a line for --alignment sim3 or se3",
         "--alignment first or none");
  }
  PoseEvaluation evaluation;
  evaluation.ate = ComputeAte(comparison->views);
  evaluation.rpe = ComputeRpe(comparison->views, options.rpe);
  evaluation.order = OrderName(reference.key);
  evaluation.num_reference = reference.poses.size();
  evaluation.num_surplus = matched.num_surplus;
  evaluation.notes = std::move(matched.notes);
  if (auto warning = WarnOfReading(matched.estimate, options.repair, reference.poses)) {
    evaluation.warnings.push_back(*std::move(warning));
  } else if (auto other = WarnOfNames(matched.estimate, reference.poses)) {
    evaluation.warnings.push_back(*std::move(other));
  }
  if (options.count_missing) {
    const size_t num_views = reference.poses.size();
    evaluation.num_wrong_pairs = num_views * (num_views - 1) / 2 - comparison->pairs.size();
  }
  for (const int64_t threshold_deg : options.auc_deg) {
    evaluation.accuracies.push_back(ComputePairAccuracy(
        comparison->pairs, static_cast<int>(threshold_deg), evaluation.num_wrong_pairs));
  }
  evaluation.comparison = *std::move(comparison);
  return evaluation;
}

}  // namespace vgtw
