// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace vgtw {

// Rows of text with aligned columns, the first left, the others right; the first row is the header.
std::string FormatTable(const std::vector<std::vector<std::string>>& rows);

// A number with `digits` behind the point; "-" for NaN.
std::string FormatNumber(double value, int digits);

}  // namespace vgtw
