// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/comparison_text.h"

#include "plugin/table.h"

#include <algorithm>
#include <vector>

namespace vgtw {
namespace {

using nlohmann::json;
using Rows = std::vector<std::vector<std::string>>;

struct Column {
  const char* header;
  const char* key;  // of a model, or of a view of a model
  int digits;
};

constexpr Column kModelColumns[] = {{"photos", "num_images", 0},
                                    {"points", "num_points3D", 0},
                                    {"observations", "num_observations", 0},
                                    {"track", "mean_track_length", 2},
                                    {"median px", "median_px", 3},
                                    {"p90 px", "p90_px", 3},
                                    {"angle deg", "median_angle_deg", 1},
                                    {"coverage %", "coverage_percent", 0},
                                    {"held out px", "held_out_px", 3},
                                    {"on distractors", "points_on_distractors", 0},
                                    {"scale drift %", "scale_drift_percent", 3}};

constexpr Column kErrorColumns[] = {{"rotation deg", "rotation_median_deg", 3},
                                    {"direction deg", "direction_median_deg", 3},
                                    {"centre %", "centre_rmse_percent", 3}};

// Shown of the last model only.
constexpr Column kLastColumns[] = {{"observations", "num_observations", 0},
                                   {"angle deg", "median_angle_deg", 1},
                                   {"coverage %", "coverage_percent", 0},
                                   {"on distractors", "observations_on_distractors", 0},
                                   {"turned deg", "rotation_change_deg", 3},
                                   {"moved %", "centre_change_percent", 3}};

// Shown of every model.
constexpr Column kEachColumns[] = {{"held out px", "held_out_px", 2},
                                   {"error deg", "rotation_error_deg", 3},
                                   {"error %", "centre_error_percent", 3}};

constexpr const char* kCsvKeys[] = {"num_observations",
                                    "mean_track_length",
                                    "median_px",
                                    "held_out_px",
                                    "median_angle_deg",
                                    "coverage_percent",
                                    "observations_on_distractors",
                                    "rotation_change_deg",
                                    "centre_change_percent",
                                    "rotation_error_deg",
                                    "centre_error_percent",
                                    "status",
                                    "reason"};

constexpr const char* kUnknown = "-";

std::string Cell(const json& object, const Column& column) {
  if (object.is_null() || !object.contains(column.key)) return kUnknown;
  const json& value = object.at(column.key);
  return value.is_number() ? FormatNumber(value, column.digits) : kUnknown;
}

Rows WithoutEmptyColumns(const Rows& rows) {
  Rows kept(rows.size());
  for (size_t column = 0; column < rows.front().size(); ++column) {
    const bool is_known = std::any_of(
        rows.begin() + 1, rows.end(), [&](const auto& row) { return row[column] != kUnknown; });
    if (column > 0 && !is_known) continue;
    for (size_t i = 0; i < rows.size(); ++i) kept[i].push_back(rows[i][column]);
  }
  return kept;
}

Rows ModelRows(const json& comparison) {
  Rows rows = {{"model"}};
  for (const Column& column : kModelColumns) rows.front().push_back(column.header);
  for (const Column& column : kErrorColumns) {
    rows.front().push_back(std::string("error: ") + column.header);
  }
  for (const json& model : comparison.at("models")) {
    auto& row = rows.emplace_back(std::vector<std::string>{model.at("name")});
    for (const Column& column : kModelColumns) row.push_back(Cell(model, column));
    for (const Column& column : kErrorColumns) row.push_back(Cell(model.at("pose_error"), column));
  }
  return WithoutEmptyColumns(rows);
}

Rows ViewRows(const json& comparison) {
  Rows rows = {{"photo", "excluded %"}};
  const json& models = comparison.at("models");
  for (const Column& column : kLastColumns) rows.front().push_back(column.header);
  for (const Column& column : kEachColumns) {
    for (const json& model : models) {
      rows.front().push_back(model.at("name").get<std::string>() + " " + column.header);
    }
  }
  rows.front().push_back("status");
  for (const json& view : comparison.at("views")) {
    auto& row = rows.emplace_back(
        std::vector<std::string>{view.at("name"), Cell(view, {"", "excluded_percent", 1})});
    const json& by_model = view.at("by_model");
    for (const Column& column : kLastColumns) row.push_back(Cell(by_model.back(), column));
    for (const Column& column : kEachColumns) {
      for (const json& of_model : by_model) row.push_back(Cell(of_model, column));
    }
    const json& last = by_model.back();
    const bool has_status = last.is_object() && last.at("status").is_string();
    row.push_back(has_status ? last.at("status").get<std::string>() : kUnknown);
  }
  return WithoutEmptyColumns(rows);
}

std::vector<std::string> Lines(const json& comparison) {
  std::vector<std::string> lines;
  for (const json& entry : comparison.at("guilty")) {
    lines.push_back("look at " + entry.at("name").get<std::string>() + ": " +
                    entry.at("why").get<std::string>());
  }
  for (const json& note : comparison.at("notes")) {
    lines.push_back("note: " + note.get<std::string>());
  }
  lines.push_back(comparison.at("alignment"));
  return lines;
}

std::string MarkdownCell(const std::string& text) {
  std::string cell;
  for (const char c : text) {
    if (c == '|' || c == '\\') cell += '\\';
    cell += c == '\n' || c == '\r' ? ' ' : c;
  }
  return cell;
}

std::string MarkdownTable(const Rows& rows) {
  std::string text;
  for (size_t i = 0; i < rows.size(); ++i) {
    text += "|";
    for (const std::string& cell : rows[i]) text += " " + MarkdownCell(cell) + " |";
    text += "\n";
    if (i > 0) continue;
    text += "|---|";
    for (size_t column = 1; column < rows[i].size(); ++column) text += "---:|";
    text += "\n";
  }
  return text;
}

std::string CsvCell(const json& value) {
  if (value.is_null()) return "";
  if (!value.is_string()) return value.dump();
  const std::string text = value;
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string CsvRow(const json& photo, const json& model, const json& figures) {
  std::string row = CsvCell(photo) + "," + CsvCell(model);
  for (const char* key : kCsvKeys) {
    row += "," + CsvCell(figures.contains(key) ? figures.at(key) : json(nullptr));
  }
  return row + "\r\n";
}

}  // namespace

std::string FormatComparison(const json& comparison) {
  std::string text;
  for (const json& sentence : comparison.at("summary")) text += sentence.get<std::string>() + "\n";
  text += "\n" + FormatTable(ModelRows(comparison));
  text += "\n" + FormatTable(ViewRows(comparison)) + "\n";
  for (const std::string& line : Lines(comparison)) text += line + "\n";
  return text;
}

std::string ComparisonAsMarkdown(const json& comparison) {
  std::string text = "# " + comparison.at("title").get<std::string>() + "\n\n";
  for (const json& sentence : comparison.at("summary")) text += sentence.get<std::string>() + "\n";
  text += "\n" + MarkdownTable(ModelRows(comparison));
  text += "\n" + MarkdownTable(ViewRows(comparison)) + "\n";
  for (const std::string& line : Lines(comparison)) text += "- " + line + "\n";
  return text;
}

std::string ComparisonAsCsv(const json& comparison) {
  std::string text = "photo,model";
  for (const char* key : kCsvKeys) text += std::string(",") + key;
  text += "\r\n";
  const json& models = comparison.at("models");
  for (const json& model : models) {
    json figures = model;
    if (model.at("pose_error").is_object()) {
      figures["rotation_error_deg"] = model.at("pose_error").at("rotation_median_deg");
      figures["centre_error_percent"] = model.at("pose_error").at("centre_rmse_percent");
    }
    text += CsvRow("", model.at("name"), figures);
  }
  for (const json& view : comparison.at("views")) {
    for (size_t i = 0; i < models.size(); ++i) {
      const json& figures = view.at("by_model").at(i);
      if (figures.is_object()) text += CsvRow(view.at("name"), models.at(i).at("name"), figures);
    }
  }
  return text;
}

}  // namespace vgtw
