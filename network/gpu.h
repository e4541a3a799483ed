// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct Gpu {
  std::string name;
  uint64_t memory_bytes = 0;  // on the board, used or not
};

// The GPUs that the CUDA driver of this machine offers, whatever LibTorch was built with: so that a
// GPU that a CPU-only LibTorch leaves idle can be told from no GPU at all.
// Empty if there is no driver, or if it says that it has no device or is not usable.
// `driver` is the driver's shared library, found like any other.
std::vector<Gpu> ListGpus(const std::filesystem::path& driver = "libcuda.so.1");

}  // namespace vgtw
