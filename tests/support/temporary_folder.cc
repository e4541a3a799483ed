// SPDX-License-Identifier: BSD-3-Clause
#include "tests/support/temporary_folder.h"

#include "scene/error.h"
#include "scene/files.h"

#include <stdlib.h>

namespace vgtw {

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "vgtw-test-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) FailErrno(name, "cannot be made");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::map<std::string, std::string> Snapshot(const std::filesystem::path& folder) {
  std::map<std::string, std::string> bytes_by_name;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    bytes_by_name[entry.path().lexically_relative(folder).string()] = ReadFile(entry.path());
  }
  return bytes_by_name;
}

}  // namespace vgtw
