// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/protocol_report.h"

#include "plugin/json_number.h"
#include "plugin/table.h"
#include "scene/files.h"

#include <array>
#include <string_view>

namespace vgtw {
namespace {

using nlohmann::json;

constexpr std::array<std::string_view, 9> kTextMetrics = {
    "acc", "comp", "nc", "overall", "abs_rel", "delta", "rpe_trans", "rpe_rot", "ate"};

}  // namespace

void WriteTableFiles(const std::filesystem::path& folder, const std::vector<ResultTable>& tables) {
  std::string all =
      "\\documentclass{article}\n\\usepackage{amsmath}\n\\usepackage{booktabs}\n"
      "\\usepackage{graphicx}\n\\usepackage[margin=2cm]{geometry}\n\\begin{document}\n";
  for (const ResultTable& table : tables) {
    WriteFileAtomically(folder / (table.name + ".csv"), FormatCsv(table));
    WriteFileAtomically(folder / (table.name + ".tex"), FormatLatex(table));
    all += "\\input{" + table.name + "}\n";
  }
  WriteFileAtomically(folder / "all_tables.tex", all + "\\end{document}\n");
}

json ScoresAsJson(const std::vector<SystemScores>& systems) {
  json rows = json::array();
  for (const SystemScores& system : systems) {
    for (const auto& [scene, scores] : system.scenes) {
      json row = {{"system", system.name},
                  {"scene", scene},
                  {"conditions", scores.conditions},
                  {"warnings", scores.warnings}};
      for (const Metric& metric : Metrics()) {
        row[std::string(metric.key)] = NumberOrNull(scores.*metric.value);
      }
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

json AsJson(const ResultTable& table) {
  json columns = json::array();
  for (const TableGroup& group : table.groups) {
    for (const TableMetric& metric : table.metrics) {
      columns.push_back({{"heads", group.heads}, {"scenes", group.scenes}, {"metric", metric.key}});
    }
  }
  json rows = json::array();
  for (const TableRow& row : table.rows) {
    json values = json::array();
    for (const double value : row.values) values.push_back(NumberOrNull(value));
    rows.push_back({{"system", row.system},
                    {"source", row.is_published ? "paper" : "measured"},
                    {"values", std::move(values)}});
  }
  return {{"name", table.name},
          {"title", table.title},
          {"conditions", table.conditions},
          {"columns", std::move(columns)},
          {"rows", std::move(rows)}};
}

std::string ScoresText(const Protocol& protocol, const std::vector<SystemScores>& systems) {
  std::vector<std::vector<std::string>> rows = {{"scene", "system"}};
  for (const std::string_view key : kTextMetrics) {
    rows[0].emplace_back(FindMetric(key)->title);
  }
  for (const ProtocolScene& scene : protocol.scenes) {
    for (const SystemScores& system : systems) {
      rows.push_back({scene.name, system.name});
      const auto scores = system.scenes.find(scene.name);
      for (const std::string_view key : kTextMetrics) {
        const Metric& metric = *FindMetric(key);
        const bool is_measured = scores != system.scenes.end();
        const double value = is_measured ? scores->second.*metric.value : SceneScores::kNone;
        rows.back().push_back(FormatNumber(value, metric.digits + 1));
      }
    }
  }
  return FormatTable(rows);
}

}  // namespace vgtw
