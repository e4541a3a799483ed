// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/pipeline.h"
#include "plugin/workspace.h"

#include <string>

#include <nlohmann/json.hpp>

namespace vgtw {

// The resolved options as run.json keeps them, grouped by the stage that they concern:
// "mask", "features", "matches", "refine", "priors".
nlohmann::json OptionsAsJson(const PipelineOptions& options);

nlohmann::json AsJson(const ReprojectionStats& stats);
nlohmann::json AsJson(const PoseComparison& comparison);
nlohmann::json AsJson(const PipelineReport& report);

// Reads the two models of a finished workspace and says what each photo and each step brought.
PipelineReport MakeReport(const Workspace& workspace, const PipelineOptions& options);

// Writes report.html of a finished workspace: its two models side by side (plugin/comparison.h).
void WriteReportPage(const Workspace& workspace, const PipelineOptions& options);

}  // namespace vgtw
