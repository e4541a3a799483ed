// SPDX-License-Identifier: BSD-3-Clause
#include "tests/support/shared_data.h"

#include <cstdlib>

namespace vgtw {
namespace {

std::filesystem::path FolderOrNone(const char* variable, const std::filesystem::path& usual) {
  const char* chosen = std::getenv(variable);
  const std::filesystem::path path = chosen != nullptr ? chosen : usual;
  return std::filesystem::is_directory(path) ? path : std::filesystem::path();
}

}  // namespace

std::filesystem::path SharedData() { return FolderOrNone("VGTW_SHARED_DATA", VGTW_SHARED_DATA); }

std::filesystem::path ParityData() {
  return FolderOrNone("VGTW_PARITY_DIR",
                      std::filesystem::path(VGTW_SHARED_DATA).parent_path() / "parity");
}

}  // namespace vgtw
