// SPDX-License-Identifier: BSD-3-Clause
// How findings are told, of masks and of training data.
#pragma once

#include "bridge/mask_lint.h"

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// "1 error", "2 errors"
std::string Plural(size_t count, std::string_view noun);

// Each of `rules` that has findings, with the first 20 of them, a line each; "" without any.
std::string FindingsText(std::span<const LintRule> rules, const std::vector<LintFinding>& findings);

// [{"code", "severity": "error"|"warning"|"note", "name", "detail"}, ...]
nlohmann::json FindingsJson(const std::vector<LintFinding>& findings);

}  // namespace vgtw
