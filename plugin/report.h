// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/comparison.h"
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

// The two models of a finished workspace, feed-forward and refined, and what they are compared by.
ComparisonInputs ReadRun(const Workspace& workspace, const PipelineOptions& options);

// Says what each photo and each step of a run brought.
PipelineReport MakeReport(const Workspace& workspace, const ComparisonInputs& run);

}  // namespace vgtw
