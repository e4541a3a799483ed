// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import.h"
#include "evaluation/pose_error.h"
#include "evaluation/trajectory_error.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct PoseEvaluationOptions {
  std::filesystem::path input_path;  // of ReadPoseSet, as the next
  std::filesystem::path reference_path;
  double max_time_difference_sec = 0.01;
  ConventionRepair repair = {};  // of the input
  PoseAlignmentOptions alignment = {};
  RpeOptions rpe = {};
  std::vector<int64_t> auc_deg = {3, 5, 10, 30};
  bool count_missing = false;  // pairs of views that the input lacks are wrong ones
};

struct PoseEvaluation {
  PoseComparison comparison;
  ErrorStatistics ate;
  std::optional<RelativePoseErrors> rpe;  // none if there are too few views
  std::string order;                      // of the views: "names", "timestamps", "lines"
  std::vector<PairAccuracy> accuracies;   // one per auc_deg
  size_t num_wrong_pairs = 0;             // of missing views, if they count
  size_t num_reference = 0;               // views
  size_t num_surplus = 0;                 // poses of the input without a reference
  std::vector<std::string> notes;
  std::vector<std::string> warnings;  // suspected mistakes of conventions, with what mends them
};

// Reads both, matches, aligns and measures. Throws Error if either is unreadable or the views in
// common do not determine the alignment.
PoseEvaluation EvaluatePoses(const PoseEvaluationOptions& options);

}  // namespace vgtw
