// SPDX-License-Identifier: BSD-3-Clause
#include "tests/support/shared_data.h"

#include <cstdlib>

namespace vgtw {

std::filesystem::path SharedData() {
  const char* chosen = std::getenv("VGTW_SHARED_DATA");
  const std::filesystem::path path = chosen != nullptr ? chosen : VGTW_SHARED_DATA;
  return std::filesystem::is_directory(path) ? path : std::filesystem::path();
}

}  // namespace vgtw
