// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/protocol.h"
#include "plugin/result_table.h"

#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// What a system gets on a scene; NaN = not measured. Distances in scene units of the reference,
// after the protocol's alignment.
struct SceneScores {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  double acc = kNone;  // see CloudError: means, then medians
  double comp = kNone;
  double overall = kNone;
  double nc = kNone;
  double acc_median = kNone;
  double comp_median = kNone;
  double nc_median = kNone;
  double abs_rel = kNone;  // see DepthError
  double delta_percent = kNone;
  double rpe_trans = kNone;  // RMSE, scene units of the pose reference
  double rpe_rot_deg = kNone;
  double ate = kNone;
  double mask_accuracy = kNone;  // means over images, see MaskRatios
  double mask_precision = kNone;
  double mask_recall = kNone;
  double mask_f1 = kNone;
  double mask_iou = kNone;
  double mask_dice = kNone;

  nlohmann::json conditions = nlohmann::json::object();  // per part, what the numbers hold under
  std::vector<std::string> warnings;  // what could not be measured, or is not as the protocol says
};

// A column of tables.
struct Metric {
  std::string_view key;    // in files
  std::string_view title;  // in text
  std::string_view latex;  // without the arrow
  bool is_lower_better;
  int digits;
  double SceneScores::*value;
};

std::span<const Metric> Metrics();
// nullptr if there is none of this key.
const Metric* FindMetric(std::string_view key);
TableMetric ColumnOf(const Metric& metric);

struct ScenePaths {
  std::filesystem::path prediction;
  std::filesystem::path reference;  // "" = none
};

// Measures what can be: a part that cannot is a warning, not a failure. Paths of `scene` absolute.
SceneScores ScoreScene(const ProtocolScene& scene,
                       const ProtocolConditions& conditions,
                       const ScenePaths& paths,
                       int num_threads);

}  // namespace vgtw
