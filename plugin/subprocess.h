// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace vgtw {

struct SubprocessResult {
  int exit_code = 0;   // 128 + signal if a signal ended it
  std::string output;  // the last 64 KiB of stdout and stderr together
};

// Runs an executable with the parent's environment, without a shell and without standard input.
// stdout and stderr go line by line to `on_line` and, if `log_path` is not empty, to the end of
// that file. Throws Error if it cannot be started.
SubprocessResult RunSubprocess(const std::filesystem::path& executable,
                               const std::vector<std::string>& arguments,
                               const std::filesystem::path& log_path = {},
                               const std::function<void(const std::string&)>& on_line = {});

// The path of an executable: `name` itself if it holds a '/', else the first match on PATH; "" if
// there is none that may be executed.
std::filesystem::path FindExecutable(const std::string& name);

// One line that a person can paste into a shell.
std::string ShellLine(const std::filesystem::path& executable,
                      const std::vector<std::string>& arguments);

}  // namespace vgtw
