// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace vgtw {

// report.html: one HTML file that needs no other, with `data` (plugin/comparison.h and, for what is
// drawn, plugin/comparison_pictures.h) inside and the scripts that draw it. The summary stands
// there as text, too; any key may be missing or null.
//
// Law: whatever strings `data` holds, they end as text, never as markup or script; the page's
// policy (CSP) allows its own two scripts, known by their hashes, and no network.
std::string MakeReportPage(const nlohmann::json& data);

// Whether the 3D library was there when the program was built; without it the page leaves the 3D
// view out and says why.
bool ReportPageHas3D();

// `data` as JSON in UTF-8 for a script element of type application/json: the characters < > &
// U+2028 U+2029 are written as escapes, and bytes that are no UTF-8 become U+FFFD.
std::string JsonForScript(const nlohmann::json& data);

// Text for HTML, also within quoted attributes.
std::string EscapeHtml(std::string_view text);

}  // namespace vgtw
