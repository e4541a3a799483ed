// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/result_table.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

ResultTable SampleTable() {
  ResultTable table;
  table.name = "points";
  table.title = "Points";
  table.conditions = "50 % of a_b";
  table.groups = {{{"Low", "A"}, {"a"}},
                  {{"Low", "B"}, {"b"}},
                  {{"High", "C"}, {"c"}},
                  {{"Mean", ""}, {"a", "b", "c"}}};
  table.metrics = {{"acc", "Acc$\\downarrow$", true, 2}, {"nc", "NC$\\uparrow$", false, 2}};
  const double none = std::nan("");
  table.rows = {{"one", "", false, {0.104, 0.5, 0.2, none, 0.3, 0.3, 0.1, 0.1}},
                {"two_2", "", false, {0.096, 0.6, 0.4, none, none, 0.3, none, 0.2}},
                {"pi3", "$\\pi^3$", true, {0.01, 0.9, 0.02, 0.9, 0.03, 0.9, 0.04, 0.9}}};
  return table;
}

TEST(FormatLatex, HeadsSpanTheirColumns) {
  const std::string latex = FormatLatex(SampleTable());
  EXPECT_THAT(latex, HasSubstr("\\begin{tabular}{l|cc|cc|cc|cc}\n"));
  EXPECT_THAT(latex,
              HasSubstr(" & \\multicolumn{4}{c}{Low} & \\multicolumn{2}{c}{High} & "
                        "\\multicolumn{2}{c}{Mean} \\\\\n\\cmidrule(lr){2-5} \\cmidrule(lr){6-7} "
                        "\\cmidrule(lr){8-9}\n"));
  EXPECT_THAT(latex,
              HasSubstr(" & \\multicolumn{2}{c}{A} & \\multicolumn{2}{c}{B} & "
                        "\\multicolumn{2}{c}{C} & \\multicolumn{2}{c}{} \\\\\n"
                        "\\cmidrule(lr){2-3} \\cmidrule(lr){4-5} \\cmidrule(lr){6-7}\n"));
  EXPECT_THAT(latex, HasSubstr("\\caption{Points. 50 \\% of a\\_b. Rows marked (paper) are"));
}

TEST(FormatLatex, BestOfEitherKindIsBoldWithItsEquals) {
  ResultTable table = SampleTable();
  const std::string latex = FormatLatex(table);
  // 0.104 and 0.096 both print as 0.10; what was not measured is a dash; one value is no best.
  EXPECT_THAT(latex,
              HasSubstr("one & \\textbf{0.10} & 0.50 & \\textbf{0.20} & - & 0.30 & "
                        "\\textbf{0.30} & 0.10 & 0.10 \\\\\n"));
  EXPECT_THAT(latex,
              HasSubstr("two\\_2 & \\textbf{0.10} & \\textbf{0.60} & 0.40 & - & - & "
                        "\\textbf{0.30} & - & \\textbf{0.20} \\\\\n"));
  EXPECT_THAT(latex, HasSubstr("\\midrule\n$\\pi^3$ (paper) & 0.01 & 0.90"));
  table.rows.push_back(table.rows.back());
  table.rows.back().values[0] = 0.02;
  EXPECT_THAT(FormatLatex(table), HasSubstr("(paper) & \\textbf{0.01} & \\textbf{0.90}"));
}

TEST(FormatCsv, HoldsEveryDigit) {
  ResultTable table = SampleTable();
  table.rows.resize(1);
  table.rows[0].values[0] = 1.0 / 3.0;
  EXPECT_EQ(FormatCsv(table),
            "system,source,\"Low A acc\",\"Low A nc\",\"Low B acc\",\"Low B nc\",\"High C acc\","
            "\"High C nc\",\"Mean acc\",\"Mean nc\"\n"
            "\"one\",measured,0.3333333333333333,0.5,0.2,,0.3,0.3,0.1,0.1\n");
}

TEST(EscapedForLatex, LeavesNothingToInterpret) {
  EXPECT_EQ(EscapedForLatex("a_b & 50% {$x^2~\\y} <#>"),
            "a\\_b \\& 50\\% \\{\\$x\\^{}2\\~{}\\textbackslash{}y\\} $<$\\#$>$");
}

}  // namespace
}  // namespace vgtw
