// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "plugin/result_table.h"

#include <string_view>
#include <vector>

namespace vgtw {

// The numbers that the paper of VGTW printed, as they stand there (plugin/paper_tables.json). Its
// distances are in units of a pseudo ground truth that was not published: they tell orders of
// magnitude and ranks, not errors of what is measured here.

// Tables 1-5 and those of the appendix, in its order; every row is_published.
const std::vector<ResultTable>& PaperTables();

// Seconds of one pass of a network; the scenes of a group are its number of views, as text.
const ResultTable& PaperTimes();

namespace paper_files {
extern const std::string_view tables_json;  // embedded when the program is built
}  // namespace paper_files

}  // namespace vgtw
