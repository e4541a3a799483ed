// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/lint_text.h"

namespace vgtw {
namespace {

const char* Word(LintSeverity severity) {
  if (severity == LintSeverity::kError) return "error";
  return severity == LintSeverity::kWarning ? "warning" : "note";
}

}  // namespace

std::string Plural(size_t count, std::string_view noun) {
  return std::to_string(count) + " " + std::string(noun) + (count == 1 ? "" : "s");
}

std::string FindingsText(std::span<const LintRule> rules,
                         const std::vector<LintFinding>& findings) {
  constexpr size_t kMaxShown = 20;
  std::string text;
  for (const LintRule& rule : rules) {
    std::string lines;
    size_t count = 0;
    for (const LintFinding& finding : findings) {
      if (finding.rule != &rule || count++ >= kMaxShown) continue;
      const std::string colon = finding.name.empty() || finding.detail.empty() ? "" : ": ";
      lines += "  " + finding.name + colon + finding.detail + "\n";
    }
    if (count == 0) continue;
    if (count > kMaxShown) {
      lines += "  and " + std::to_string(count - kMaxShown) + " more (all with --json)\n";
    }
    text += std::string(Word(rule.severity)) + " " + std::string(rule.code) + ": " +
            std::string(rule.meaning) + "; to do: " + std::string(rule.advice) + "\n" + lines;
  }
  return text;
}

nlohmann::json FindingsJson(const std::vector<LintFinding>& findings) {
  nlohmann::json result = nlohmann::json::array();
  for (const LintFinding& finding : findings) {
    result.push_back({{"code", finding.rule->code},
                      {"severity", Word(finding.rule->severity)},
                      {"name", finding.name},
                      {"detail", finding.detail}});
  }
  return result;
}

}  // namespace vgtw
