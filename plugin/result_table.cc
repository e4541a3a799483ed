// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/result_table.h"

#include "plugin/table.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>

namespace vgtw {
namespace {

std::string QuotedForCsv(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += c;
    quoted += c;
  }
  return quoted + "\"";
}

// The fewest digits that read back as the same double.
std::string Exact(double value) {
  if (!std::isfinite(value)) return "";
  std::array<char, 32> buffer;
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), result.ptr};
}

std::string Joined(const std::vector<std::string>& heads) {
  std::string text;
  for (const std::string& head : heads) {
    if (!head.empty()) text += head + " ";
  }
  return text;
}

const TableMetric& MetricOf(const ResultTable& table, size_t column) {
  return table.metrics[column % table.metrics.size()];
}

std::string Cell(double value, const TableMetric& metric) {
  return FormatNumber(value, metric.digits);
}

// The best printed value of a column among the rows of one kind; nullopt without two of them.
std::optional<std::string> Best(const ResultTable& table, size_t column, bool is_published) {
  const TableMetric& metric = MetricOf(table, column);
  std::optional<double> best;
  int num_values = 0;
  for (const TableRow& row : table.rows) {
    const double value = row.values[column];
    if (row.is_published != is_published || !std::isfinite(value)) continue;
    ++num_values;
    if (!best || (metric.is_lower_better ? value < *best : value > *best)) best = value;
  }
  if (num_values < 2) return std::nullopt;
  return Cell(*best, metric);
}

std::string LatexRow(const ResultTable& table, const TableRow& row) {
  std::string text = row.latex.empty() ? EscapedForLatex(row.system) : row.latex;
  if (row.is_published) text += " (paper)";
  for (size_t column = 0; column < row.values.size(); ++column) {
    const std::string cell = Cell(row.values[column], MetricOf(table, column));
    const bool is_best = std::isfinite(row.values[column]) &&
                         cell == Best(table, column, row.is_published).value_or("");
    text += " & " + (is_best ? "\\textbf{" + cell + "}" : cell);
  }
  return text + " \\\\\n";
}

// Whether two neighbouring groups share the head of this level and of those above.
bool SharesHead(const TableGroup& a, const TableGroup& b, size_t level) {
  return std::equal(
      a.heads.begin(), a.heads.begin() + static_cast<std::ptrdiff_t>(level) + 1, b.heads.begin());
}

// One line of heads, with a rule below each.
std::string LatexHeads(const ResultTable& table, size_t level) {
  std::string cells;
  std::string rules;
  for (size_t first = 0; first < table.groups.size();) {
    size_t last = first;
    while (last + 1 < table.groups.size() &&
           SharesHead(table.groups[first], table.groups[last + 1], level)) {
      ++last;
    }
    const size_t num_metrics = table.metrics.size();
    const size_t begin = 2 + first * num_metrics;  // columns count from 1, the first is the system
    const size_t end = 1 + (last + 1) * num_metrics;
    const std::string& head = table.groups[first].heads[level];
    cells += " & \\multicolumn{" + std::to_string(end - begin + 1) + "}{c}{" +
             EscapedForLatex(head) + "}";
    if (!head.empty()) {
      rules += "\\cmidrule(lr){" + std::to_string(begin) + "-" + std::to_string(end) + "} ";
    }
    first = last + 1;
  }
  if (!rules.empty()) rules.back() = '\n';
  return cells + " \\\\\n" + rules;
}

std::string LatexColumns(const ResultTable& table) {
  std::string columns = "l";
  for (size_t i = 0; i < table.groups.size(); ++i) {
    columns += "|" + std::string(table.metrics.size(), 'c');
  }
  return columns;
}

std::string LatexBody(const ResultTable& table) {
  std::string text;
  for (const bool is_published : {false, true}) {
    std::string rows;
    for (const TableRow& row : table.rows) {
      if (row.is_published == is_published) rows += LatexRow(table, row);
    }
    if (!rows.empty()) text += "\\midrule\n" + rows;
  }
  return text;
}

std::string Caption(const ResultTable& table) {
  std::string caption = table.title + ".";
  if (!table.conditions.empty()) caption += " " + table.conditions + ".";
  if (std::any_of(table.rows.begin(), table.rows.end(), [](const TableRow& row) {
        return row.is_published;
      })) {
    caption += " Rows marked (paper) are published numbers, measured elsewhere.";
  }
  return EscapedForLatex(caption);
}

}  // namespace

std::string EscapedForLatex(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '\\':
        escaped += "\\textbackslash{}";
        break;
      case '~':
      case '^':
        escaped += std::string("\\") + c + "{}";
        break;
      case '<':
      case '>':
      case '|':
        escaped += std::string("$") + c + "$";
        break;
      case '&':
      case '%':
      case '$':
      case '#':
      case '_':
      case '{':
      case '}':
        escaped += '\\';
        [[fallthrough]];
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string FormatCsv(const ResultTable& table) {
  std::string text = "system,source";
  for (const TableGroup& group : table.groups) {
    for (const TableMetric& metric : table.metrics) {
      text += "," + QuotedForCsv(Joined(group.heads) + metric.key);
    }
  }
  text += "\n";
  for (const TableRow& row : table.rows) {
    text += QuotedForCsv(row.system) + (row.is_published ? ",paper" : ",measured");
    for (const double value : row.values) text += "," + Exact(value);
    text += "\n";
  }
  return text;
}

std::string FormatLatex(const ResultTable& table) {
  std::string text = "\\begin{table}[htbp]\n\\centering\n\\caption{" + Caption(table) +
                     "}\n\\label{tab:" + table.name + "}\n" +
                     "\\resizebox{\\ifdim\\width>\\textwidth\\textwidth\\else\\width\\fi}{!}{%\n" +
                     "\\begin{tabular}{" + LatexColumns(table) + "}\n\\toprule\n";
  const size_t num_levels = table.groups.empty() ? 0 : table.groups.front().heads.size();
  for (size_t level = 0; level < num_levels; ++level) text += LatexHeads(table, level);
  for (size_t i = 0; i < table.groups.size(); ++i) {
    for (const TableMetric& metric : table.metrics) text += " & " + metric.latex;
  }
  text += " \\\\\n" + LatexBody(table);
  return text + "\\bottomrule\n\\end{tabular}}\n\\end{table}\n";
}

}  // namespace vgtw
