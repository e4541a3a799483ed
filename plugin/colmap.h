// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace vgtw {

// (option without "--", value), in 3.8's words.
using ColmapOptions = std::vector<std::pair<std::string, std::string>>;

// The real colmap, whatever its version. Options are given in 3.8's words and translated to those
// of the version at hand (it is asked by `colmap COMMAND -h`).
class Colmap {
 public:
  // "" = the first `colmap` on PATH. Throws Error if there is none, with the package to install.
  explicit Colmap(const std::filesystem::path& executable = {});

  const std::filesystem::path& executable() const { return executable_; }
  const std::string& version() const { return version_; }  // for instance "3.8"

  // Runs `colmap command`, prints the line, appends the output to `log_path`. Its exit code says
  // little (see docs/design.md): callers judge what it wrote. Options that this version does not
  // know by any name are left out. `progress` is fed from lines like "[3/20]".
  // Returns the exit code; `last_words` gets the last lines, for error messages.
  int Run(const std::string& command,
          const ColmapOptions& options,
          const std::filesystem::path& log_path,
          const ProgressCallback& progress = {},
          std::string* last_words = nullptr) const;

  // The name under which this version's `command` knows an option of 3.8, or "".
  std::string Translate(const std::string& command, const std::string& option) const;

 private:
  const std::string& Help(const std::string& command) const;

  std::filesystem::path executable_;
  std::string version_;
  mutable std::map<std::string, std::string> help_by_command_;
};

}  // namespace vgtw
