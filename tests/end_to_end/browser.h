// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// A browser without a window: $VGTW_CHROMIUM, else `chromium` on PATH; "" if there is none.
std::filesystem::path BrowserExecutable();

struct Visit {
  std::string hash = "";   // the page's state, without '#'
  int width = 1280;        // of the page, pixels
  bool dark = false;       // whether the visitor prefers dark colours
  std::string steps = "";  // JavaScript in an async function, see report_page_harness.js
};

// report.html of `data` in a real browser. Each visit opens it anew and adds a test failure for
// every message on the browser's console.
class ReportInBrowser {
 public:
  explicit ReportInBrowser(const nlohmann::json& data);

  // What the steps return.
  nlohmann::json Ask(const Visit& visit) const;

  // The page on paper (US letter) as a PDF, which lives as long as this.
  std::filesystem::path Print(bool dark) const;

  // After the steps, the 3D view alone, 400 x 300.
  RgbImage SeeStage(Visit visit) const;

 private:
  std::string Run(const Visit& visit, const std::vector<std::string>& arguments) const;
  std::string Open(const std::string& page,
                   bool dark,
                   const std::vector<std::string>& arguments) const;

  TemporaryFolder folder_;
};

}  // namespace vgtw

// Skips the test with a printed reason where there is no browser.
#define VGTW_NEED_BROWSER()                                                                  \
  if (::vgtw::BrowserExecutable().empty()) {                                                 \
    GTEST_SKIP() << "chromium not found: install it or set VGTW_CHROMIUM to its executable"; \
  }                                                                                          \
  static_assert(true)
