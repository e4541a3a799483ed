// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace vgtw {

// The folder of real photos that lies beside the repository (or $VGTW_SHARED_DATA), or "" if it is
// absent. It is not part of the repository.
std::filesystem::path SharedData();

}  // namespace vgtw

// Skips the test with a printed reason where the photos are absent.
#define VGTW_NEED_SHARED_DATA()                                         \
  if (::vgtw::SharedData().empty()) {                                   \
    GTEST_SKIP() << "real photos are absent: ../shared/data not found"; \
  }                                                                     \
  static_assert(true)
