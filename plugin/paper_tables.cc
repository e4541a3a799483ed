// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/paper_tables.h"

#include "plugin/scene_scores.h"
#include "scene/error.h"

#include <string>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using nlohmann::json;

TableMetric MetricOf(const std::string& key, int digits) {
  const Metric* metric = FindMetric(key);
  VGTW_CHECK(metric != nullptr, "paper_tables.json has metric " + key);
  TableMetric column = ColumnOf(*metric);
  column.digits = digits;
  return column;
}

TableRow RowOf(const json& row, const char* values_key) {
  return {.system = row.at("system"),
          .latex = row.value("latex", ""),
          .is_published = true,
          .values = row.at(values_key)};
}

void CheckRows(const ResultTable& table) {
  for (const TableRow& row : table.rows) {
    VGTW_CHECK(row.values.size() == table.groups.size() * table.metrics.size(),
               "paper_tables.json has a row of another length in " + table.name);
  }
}

ResultTable TableOf(const json& object) {
  ResultTable table{.name = object.at("name"),
                    .title = object.at("title"),
                    .conditions = "",
                    .groups = {},
                    .metrics = {},
                    .rows = {}};
  for (const json& group : object.at("groups")) {
    table.groups.push_back({group.at("heads"), group.at("scenes")});
  }
  const json& digits = object.at("digits");
  for (const json& key : object.at("metrics")) {
    table.metrics.push_back(MetricOf(key, digits.at(table.metrics.size())));
  }
  for (const json& row : object.at("rows")) table.rows.push_back(RowOf(row, "values"));
  CheckRows(table);
  return table;
}

ResultTable TimesOf(const json& object) {
  ResultTable table{.name = "times",
                    .title = "Seconds of one pass of the network",
                    .conditions = "",
                    .groups = {},
                    .metrics = {{"seconds", "s", /*is_lower_better=*/true, /*digits=*/2}},
                    .rows = {}};
  for (const int64_t num_views : object.at("views")) {
    const std::string text = std::to_string(num_views);
    table.groups.push_back({{text + " views"}, {text}});
  }
  for (const json& row : object.at("rows")) table.rows.push_back(RowOf(row, "seconds"));
  CheckRows(table);
  return table;
}

const json& PaperJson() {
  static const json paper = json::parse(paper_files::tables_json);
  return paper;
}

}  // namespace

const std::vector<ResultTable>& PaperTables() {
  static const std::vector<ResultTable> tables = [] {
    std::vector<ResultTable> read;
    for (const json& object : PaperJson().at("tables")) read.push_back(TableOf(object));
    return read;
  }();
  return tables;
}

const ResultTable& PaperTimes() {
  static const ResultTable times = TimesOf(PaperJson().at("times"));
  return times;
}

}  // namespace vgtw
