// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace vgtw {

// Contents of plugin/report_page/ and of the 3D library, as they were when the program was built
// (cmake/embed_files.cmake); three_js is empty where the library was absent.
namespace report_page_files {
extern const std::string_view page_html;
extern const std::string_view page_css;
extern const std::string_view page_js;
extern const std::string_view three_js;
extern const std::string_view three_licence;
}  // namespace report_page_files

}  // namespace vgtw
