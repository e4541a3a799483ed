// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// The real COLMAP: $VGTW_COLMAP, else `colmap` on PATH; "" if there is none.
std::filesystem::path ColmapExecutable();

// A COLMAP of another version for the opt-in cross-version tests: $VGTW_COLMAP_OTHER, or "".
std::filesystem::path OtherColmapExecutable();

struct ColmapRun {
  int exit_code = -1;  // 128 + signal if it was killed by one
  std::string output;  // stdout and stderr as they came
};

// Runs `executable args...` without a display and waits for it.
ColmapRun RunColmap(const std::vector<std::string>& args,
                    const std::filesystem::path& executable = ColmapExecutable());

// The flag that turns the GPU off for feature_extractor or a matcher: COLMAP 3.13 renamed
// --SiftExtraction.use_gpu to --FeatureExtraction.use_gpu (and SiftMatching likewise). Needed on
// every run without a display, where use_gpu 1 aborts.
std::string UseGpuFlag(const std::string& command,
                       const std::filesystem::path& executable = ColmapExecutable());

}  // namespace vgtw

// Skips the test with a printed reason where there is no colmap.
#define VGTW_NEED_COLMAP()                                                               \
  if (::vgtw::ColmapExecutable().empty()) {                                              \
    GTEST_SKIP() << "colmap not found: install it or set VGTW_COLMAP to its executable"; \
  }                                                                                      \
  static_assert(true)

#define VGTW_NEED_OTHER_COLMAP()                                                       \
  if (::vgtw::OtherColmapExecutable().empty()) {                                       \
    GTEST_SKIP() << "set VGTW_COLMAP_OTHER to a colmap executable of another version"; \
  }                                                                                    \
  static_assert(true)
