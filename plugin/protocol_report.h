// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/protocol.h"
#include "plugin/protocol_tables.h"
#include "plugin/result_table.h"

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// Per table <name>.csv and <name>.tex, and all_tables.tex, which typesets all of them.
void WriteTableFiles(const std::filesystem::path& folder, const std::vector<ResultTable>& tables);

// Scores of every system and scene with their conditions; null where none was measured.
nlohmann::json ScoresAsJson(const std::vector<SystemScores>& systems);
nlohmann::json AsJson(const ResultTable& table);

// A line per scene and system: points, depth and poses.
std::string ScoresText(const Protocol& protocol, const std::vector<SystemScores>& systems);

}  // namespace vgtw
