// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/report_page.h"

#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;
using testing::Not;

// What a photo, a folder or a note might be called by someone who means harm, or not.
const std::vector<std::string> kHostileTexts = {
    "</script><script>alert(1)</script>",
    "<!-- <script>",
    "]]>\"'&amp;<img src=x onerror=alert(1)>",
    "line\u2028and\u2029paragraph.jpg",
    "@@data@@",
    "größe 写真 🌿.jpg",
    "back\\slash \n newline \t tab",
};

nlohmann::json DataOf(const std::string& text) {
  return {{"title", text},
          {"summary", {text, "second " + text}},
          {"notes", {text}},
          {"models", {{{"name", text}, {"path", text}, {"role", "after"}}}},
          {"views", {{{"name", text}, {"by_model", {nullptr}}}}}};
}

// What the page's script reads back: the content of the data element.
std::string DataElement(const std::string& page) {
  const std::string open = "<script type=\"application/json\" id=\"data\">";
  const size_t begin = page.find(open) + open.size();
  return page.substr(begin, page.find("</script", begin) - begin);
}

size_t Count(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST(ReportPage, HostileNamesComeBackAsTheyWere) {
  for (const std::string& text : kHostileTexts) {
    const nlohmann::json data = DataOf(text);
    EXPECT_EQ(nlohmann::json::parse(DataElement(MakeReportPage(data))), data) << text;
  }
}

TEST(ReportPage, HostileNamesAddNoMarkup) {
  const std::string harmless = MakeReportPage(DataOf("a.jpg"));
  for (const std::string& text : kHostileTexts) {
    const std::string page = MakeReportPage(DataOf(text));
    for (const char* mark : {"<script", "</script", "<!--", "<img", "onerror=alert(1)>"}) {
      EXPECT_EQ(Count(page, mark), Count(harmless, mark)) << mark << " in " << text;
    }
  }
}

TEST(ReportPage, JsonForScriptHasNothingThatEndsAScript) {
  for (const std::string& text : kHostileTexts) {
    const std::string json = JsonForScript(nlohmann::json(text));
    for (const char* part : {"<", ">", "&", "\u2028", "\u2029"}) {
      EXPECT_THAT(json, Not(HasSubstr(part))) << text;
    }
    EXPECT_EQ(nlohmann::json::parse(json), nlohmann::json(text));
  }
}

// A photo's name is bytes to the file system.
TEST(ReportPage, BytesThatAreNoUtf8BecomeTheReplacementCharacter) {
  const std::string json = JsonForScript(nlohmann::json("a\xff.jpg"));
  EXPECT_EQ(nlohmann::json::parse(json), nlohmann::json("a\uFFFD.jpg"));
}

TEST(ReportPage, EscapesTextForHtml) {
  EXPECT_EQ(EscapeHtml("<a href=\"x\">'&'</a>"),
            "&lt;a href=&quot;x&quot;&gt;&#39;&amp;&#39;&lt;/a&gt;");
}

TEST(ReportPage, TheAnswerStandsThereWithoutScripts) {
  const std::string page =
      MakeReportPage({{"title", "out"}, {"summary", {"B is better.", "By far."}}});
  EXPECT_THAT(page, HasSubstr("<h1>B is better.</h1>"));
  EXPECT_THAT(page, HasSubstr("<p>By far.</p>"));
  EXPECT_THAT(page, HasSubstr("<title>out</title>"));
  EXPECT_THAT(page, HasSubstr("<noscript>"));
}

// Addresses that remain are names of XML, and those in comments of the library.
TEST(ReportPage, LoadsNothing) {
  const std::string page = MakeReportPage(DataOf("a.jpg"));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
  EXPECT_THAT(page, Not(HasSubstr("url(")));
  EXPECT_THAT(page, Not(HasSubstr("@import")));
  const std::regex loading(R"((src|href|action|data)\s*=\s*["']?\s*(https?:|//|file:))");
  EXPECT_FALSE(std::regex_search(page, loading));
  EXPECT_THAT(page, Not(HasSubstr("<script src")));
  EXPECT_EQ(Count(page, "<link"), 1u);
  EXPECT_THAT(page, HasSubstr("<link rel=\"icon\" href=\"data:,\">"));
}

TEST(ReportPage, AllowsItsOwnScriptsOnly) {
  const std::string page = MakeReportPage(DataOf("a.jpg"));
  EXPECT_EQ(Count(page, "'sha256-"), Count(page, "<script>"));
  EXPECT_EQ(Count(page, "<script>"), ReportPageHas3D() ? 2u : 1u);
  const size_t policy = page.find("script-src");
  EXPECT_THAT(page.substr(policy, page.find(';', policy) - policy), Not(HasSubstr("unsafe")));
}

TEST(ReportPage, NamesTheLicenceOfWhatItHolds) {
  if (!ReportPageHas3D()) GTEST_SKIP() << "libjs-three was absent when this was built";
  const std::string page = MakeReportPage(DataOf("a.jpg"));
  EXPECT_THAT(page, HasSubstr("three.js authors"));
  EXPECT_THAT(page, HasSubstr("The above copyright notice and this permission notice"));
}

// 850 kB are the library's; the rest is ours.
TEST(ReportPage, IsLightWithoutPictures) {
  EXPECT_LT(MakeReportPage(DataOf("a.jpg")).size(), 1'000'000u);
}

}  // namespace
}  // namespace vgtw
