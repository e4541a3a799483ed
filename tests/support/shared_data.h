// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace vgtw {

// The folder of real photos that lies beside the repository (or $VGTW_SHARED_DATA), or "" if it is
// absent. It is not part of the repository.
std::filesystem::path SharedData();

// The folder of what the reference networks gave, beside that of the photos (or $VGTW_PARITY_DIR),
// or "" if it is absent. It is not part of the repository either.
std::filesystem::path ParityData();

}  // namespace vgtw

// Skips the test with a printed reason where the photos are absent.
#define VGTW_NEED_SHARED_DATA()                                         \
  if (::vgtw::SharedData().empty()) {                                   \
    GTEST_SKIP() << "real photos are absent: ../shared/data not found"; \
  }                                                                     \
  static_assert(true)

// The same for the outputs of the reference networks.
#define VGTW_NEED_PARITY_DATA()                                                 \
  if (::vgtw::ParityData().empty()) {                                           \
    GTEST_SKIP() << "reference outputs are absent: ../shared/parity not found"; \
  }                                                                             \
  static_assert(true)
