// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace vgtw {

// Columns that belong to one scene or to a mean over scenes.
struct TableGroup {
  std::vector<std::string> heads;   // from the top, as many in every group; "" = empty cell
  std::vector<std::string> scenes;  // names that the values are means over
};

struct TableMetric {
  std::string key;    // in CSV
  std::string latex;  // with its arrow
  bool is_lower_better = true;
  int digits = 3;
};

struct TableRow {
  std::string system;
  std::string latex;           // "" = `system`, escaped
  bool is_published = false;   // a number of the paper: not measured, not comparable in rank
  std::vector<double> values;  // groups x metrics, NaN = none
};

struct ResultTable {
  std::string name;  // of its files
  std::string title;
  std::string conditions;  // that the measured numbers hold under, for the caption
  std::vector<TableGroup> groups;
  std::vector<TableMetric> metrics;
  std::vector<TableRow> rows;
};

// Every value as it is ("" = none), with the columns system, source (measured or paper) and
// "<heads> <metric>".
std::string FormatCsv(const ResultTable& table);

// A table environment (needs amsmath, booktabs and graphicx) of rounded values, "-" = none:
// measured rows, then the paper's, which are marked. Among two or more rows of either kind the best
// value is bold, with all that print alike.
std::string FormatLatex(const ResultTable& table);

// Plain text with what LaTeX would take for its own replaced.
std::string EscapedForLatex(const std::string& text);

}  // namespace vgtw
