// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/config_file.h"

#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <sstream>

#include <CLI/CLI.hpp>

namespace vgtw {
namespace {

constexpr size_t kMaxBytes = size_t{1} << 20;
constexpr char kFlag[] = "--config";

bool Has(const std::vector<std::string>& arguments, const std::string& flag) {
  return std::any_of(arguments.begin(), arguments.end(), [&](const std::string& argument) {
    return argument == flag || argument.starts_with(flag + "=");
  });
}

}  // namespace

std::vector<std::string> FlagsOfConfig(const std::filesystem::path& path,
                                       const std::vector<std::string>& arguments) {
  std::istringstream text(ReadFile(path, kMaxBytes));
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(text);
  } catch (const CLI::ParseError& error) {
    Fail(path, Printable(error.what()), "lines 'name = value'");
  }
  std::vector<std::string> flags;
  for (const CLI::ConfigItem& item : items) {
    const std::string flag = "--" + item.name;
    if (!item.parents.empty()) {
      Fail(path, "has a section [" + Printable(item.parents.front()) + "]", "lines 'name = value'");
    }
    if (Has(arguments, flag)) continue;
    std::string value;
    for (const std::string& input : item.inputs) value += (value.empty() ? "" : ",") + input;
    flags.push_back(flag);
    flags.push_back(value);
  }
  return flags;
}

std::filesystem::path FindConfig(const std::vector<std::string>& arguments) {
  for (size_t i = 0; i < arguments.size(); ++i) {
    if (arguments[i] == kFlag && i + 1 < arguments.size()) return arguments[i + 1];
    const std::string prefix = std::string(kFlag) + "=";
    if (arguments[i].starts_with(prefix)) return arguments[i].substr(prefix.size());
  }
  return {};
}

}  // namespace vgtw
