// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refine/refine_model.h"

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

nlohmann::json AsJson(const BundleAdjustmentSummary& summary);
nlohmann::json AsJson(const RefineModelOptions& options);
// "views" (by name), "rounds", "num_held_out_tracks", "held_out_before_px", "held_out_after_px".
nlohmann::json AsJson(const RefineModelResult& result);

// Which views keep their pose and why, a line per reason, from the "views" of the above.
std::vector<std::string> UnrefinedNotes(const nlohmann::json& views);

// What refinement did to each view and to all, for people.
std::string FormatRefinement(const RefineModelResult& result);

}  // namespace vgtw
