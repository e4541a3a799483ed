// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace vgtw {

// CompareModels' object (plugin/comparison.h) for people and for spreadsheets. Columns of which
// nothing is known are left out, but not in CSV.

// Aligned tables for stdout.
std::string FormatComparison(const nlohmann::json& comparison);

// The same as Markdown.
std::string ComparisonAsMarkdown(const nlohmann::json& comparison);

// One row per model and photo, after one per model whose photo is empty: RFC 4180, one header.
std::string ComparisonAsCsv(const nlohmann::json& comparison);

}  // namespace vgtw
