// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tests/support/colmap.h"

#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace vgtw {

// Runs the program that was built, as a user would; output holds stdout and stderr.
inline ColmapRun RunVgtw(std::vector<std::string> args) { return RunColmap(args, VGTW_PROGRAM); }

inline nlohmann::json ReadJson(const std::filesystem::path& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

}  // namespace vgtw
