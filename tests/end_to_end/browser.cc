// SPDX-License-Identifier: BSD-3-Clause
#include "tests/end_to_end/browser.h"

#include "plugin/report_page.h"
#include "plugin/subprocess.h"
#include "scene/files.h"

#include <cstdlib>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

constexpr int kWindowHeight = 900;

// The test's own page: the report in a frame, because the least width of a window is more than a
// phone's, and the script that acts on it.
std::string HarnessPage(const Visit& visit) {
  const std::string size =
      "width:" + std::to_string(visit.width) + "px;height:" + std::to_string(kWindowHeight) + "px";
  return "<body style='margin:0'><iframe style='border:0;display:block;" + size +
         "' src='report.html#" + visit.hash + "'></iframe><pre id=answer></pre>\n<script>\n" +
         ReadFile(std::filesystem::path(VGTW_SOURCE_DIR) /
                  "tests/end_to_end/report_page_harness.js") +
         "frame.onload = () => answer(async () => {\n" + visit.steps + "\n});\n</script>\n";
}

// Lines of the console, but for hints of the software renderer about its own speed.
bool IsConsoleMessage(const std::string& line) {
  return line.find(":CONSOLE:") != std::string::npos &&
         line.find("GL Driver Message") == std::string::npos;
}

}  // namespace

std::filesystem::path BrowserExecutable() {
  const char* chosen = std::getenv("VGTW_CHROMIUM");
  return FindExecutable(chosen != nullptr ? chosen : "chromium");
}

ReportInBrowser::ReportInBrowser(const nlohmann::json& data) {
  WriteFileAtomically(folder_ / "report.html", MakeReportPage(data));
}

std::string ReportInBrowser::Run(const Visit& visit,
                                 const std::vector<std::string>& arguments) const {
  WriteFileAtomically(folder_ / "harness.html", HarnessPage(visit));
  return Open("harness.html", visit.dark, arguments);
}

std::string ReportInBrowser::Open(const std::string& page,
                                  bool dark,
                                  const std::vector<std::string>& arguments) const {
  std::vector<std::string> all = {"120",
                                  BrowserExecutable(),
                                  "--headless=new",
                                  "--no-sandbox",
                                  "--disable-gpu",
                                  "--use-angle=swiftshader",
                                  "--enable-unsafe-swiftshader",
                                  "--allow-file-access-from-files",
                                  "--hide-scrollbars",
                                  "--force-device-scale-factor=1",
                                  "--virtual-time-budget=20000",
                                  "--enable-logging=stderr",
                                  "--window-size=1280," + std::to_string(kWindowHeight),
                                  "--user-data-dir=" + (folder_ / "profile").string()};
  if (dark) all.push_back("--blink-settings=preferredColorScheme=0");
  all.insert(all.end(), arguments.begin(), arguments.end());
  all.push_back("file://" + (folder_ / page).string());
  const SubprocessResult result =
      RunSubprocess(FindExecutable("timeout"), all, {}, [](const std::string& line) {
        if (IsConsoleMessage(line)) ADD_FAILURE() << "console: " << line;
      });
  EXPECT_EQ(result.exit_code, 0) << result.output;
  return result.output;
}

nlohmann::json ReportInBrowser::Ask(const Visit& visit) const {
  const std::string output = Run(visit, {"--dump-dom"});
  const std::string open = "<pre id=\"answer\">";
  const size_t begin = output.find(open);
  const size_t end = output.find("</pre>", begin);
  if (begin == std::string::npos || end == std::string::npos) {
    ADD_FAILURE() << "no answer: " << output;
    return nullptr;
  }
  const nlohmann::json answer = nlohmann::json::parse(
      output.substr(begin + open.size(), end - begin - open.size()), nullptr, false);
  EXPECT_FALSE(answer.is_discarded()) << output;
  EXPECT_FALSE(answer.is_object() && answer.contains("error")) << answer;
  return answer;
}

std::filesystem::path ReportInBrowser::Print(bool dark) const {
  const std::filesystem::path path = folder_ / "printed.pdf";
  Open("report.html", dark, {"--print-to-pdf=" + path.string(), "--no-pdf-header-footer"});
  return path;
}

RgbImage ReportInBrowser::SeeStage(Visit visit) const {
  visit.steps = "await showStageOnly();\n" + visit.steps + "\nawait sleep(300);";
  const std::filesystem::path path = folder_ / "seen.png";
  Run(visit, {"--screenshot=" + path.string()});
  const RgbImage window = ReadRgbImage(path);
  RgbImage stage(400, 300);
  for (int y = 0; y < stage.height(); ++y) {
    for (int x = 0; x < stage.width(); ++x) stage(x, y) = window(x, y);
  }
  return stage;
}

}  // namespace vgtw
