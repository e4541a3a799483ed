// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/report_page.h"

#include "plugin/base64.h"
#include "plugin/hashing.h"
#include "plugin/report_page_files.h"

#include <cstddef>
#include <map>
#include <vector>

namespace vgtw {
namespace {

namespace files = report_page_files;

// Replaces each "@@name@@" by its value in one pass, so that values are never searched.
std::string FillTemplate(std::string_view text,
                         const std::map<std::string_view, std::string>& values) {
  constexpr std::string_view kMark = "@@";
  std::string filled;
  while (true) {
    const size_t begin = text.find(kMark);
    if (begin == std::string_view::npos) return filled.append(text);
    const size_t end = text.find(kMark, begin + kMark.size());
    filled.append(text.substr(0, begin));
    filled.append(values.at(text.substr(begin + kMark.size(), end - begin - kMark.size())));
    text.remove_prefix(end + kMark.size());
  }
}

// The source expression that lets a policy allow exactly this script.
std::string HashSource(std::string_view script) {
  const std::string hex = HashText(script);
  std::vector<std::byte> digest;
  for (size_t i = 0; i < hex.size(); i += 2) {
    digest.push_back(static_cast<std::byte>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return "'sha256-" + Base64(digest) + "'";
}

std::string Script(std::string_view body) { return "<script>" + std::string(body) + "</script>\n"; }

std::string TextOf(const nlohmann::json& data, const char* key) {
  const auto found = data.find(key);
  return found != data.end() && found->is_string() ? found->get<std::string>() : "";
}

std::vector<std::string> Sentences(const nlohmann::json& data) {
  std::vector<std::string> sentences;
  for (const nlohmann::json& sentence : data.value("summary", nlohmann::json::array())) {
    sentences.push_back(EscapeHtml(sentence.get<std::string>()));
  }
  return sentences;
}

}  // namespace

bool ReportPageHas3D() { return !files::three_js.empty(); }

std::string JsonForScript(const nlohmann::json& data) {
  const std::string json = data.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  std::string text;
  text.reserve(json.size());
  for (size_t i = 0; i < json.size(); ++i) {
    const std::string_view rest = std::string_view(json).substr(i);
    if (rest.starts_with('<')) {
      text += "\\u003c";
    } else if (rest.starts_with('>')) {
      text += "\\u003e";
    } else if (rest.starts_with('&')) {
      text += "\\u0026";
    } else if (rest.starts_with("\u2028") || rest.starts_with("\u2029")) {
      text += rest.starts_with("\u2028") ? "\\u2028" : "\\u2029";
      i += 2;
    } else {
      text += rest.front();
    }
  }
  return text;
}

std::string EscapeHtml(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string MakeReportPage(const nlohmann::json& data) {
  // A function of its own, so that the page's words do not meet names of the browser.
  const std::string page_script =
      "(() => {\n'use strict';\n" + std::string(files::page_js) + "})();";
  std::string scripts;
  std::string policy;
  if (ReportPageHas3D()) {
    scripts += "<script type=\"text/plain\" id=\"licences\">\n" +
               std::string(files::three_licence) + "</script>\n" + Script(files::three_js);
    policy += HashSource(files::three_js) + " ";
  }
  scripts += Script(page_script);
  policy += HashSource(page_script);

  const std::vector<std::string> sentences = Sentences(data);
  std::string details;
  for (size_t i = 1; i < sentences.size(); ++i) details += "<p>" + sentences[i] + "</p>\n";
  const std::string title = EscapeHtml(TextOf(data, "title"));
  return FillTemplate(files::page_html,
                      {{"policy",
                        "default-src 'none'; script-src " + policy +
                            "; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
                            "form-action 'none'"},
                       {"title", title},
                       {"css", std::string(files::page_css)},
                       {"answer", sentences.empty() ? title : sentences.front()},
                       {"details", details},
                       {"data", JsonForScript(data)},
                       {"scripts", scripts}});
}

}  // namespace vgtw
