// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/error.h"
#include "scene/files.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <unistd.h>

namespace vgtw {

// Ends the process, which libFuzzer reports with the input, where a law does not hold.
inline void Require(bool law) {
  if (!law) std::abort();
}

// Runs `parse`, which may throw vgtw::Error with one line and nothing else.
template <typename Parse>
int OnlyErrors(const Parse& parse) {
  try {
    parse();
  } catch (const Error& error) {
    const std::string_view text = error.what();
    Require(!text.empty() && text.find('\n') == std::string_view::npos);
  }
  return 0;
}

inline std::span<const std::byte> InputBytes(const uint8_t* data, size_t size) {
  return std::as_bytes(std::span(data, size));
}

inline std::string_view InputText(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// Cuts an input that stands for several files: each part is preceded by its length (u16, little-
// endian); lengths beyond the input are cut.
inline std::vector<std::string> SplitInput(const uint8_t* data, size_t size, size_t num_parts) {
  std::vector<std::string> parts;
  while (parts.size() < num_parts) {
    size_t length = 0;
    if (size >= 2) {
      length = std::min<size_t>(data[0] | data[1] << 8, size - 2);
      data += 2;
      size -= 2;
    }
    parts.emplace_back(InputText(data, length));
    data += length;
    size -= length;
  }
  return parts;
}

// A folder in memory for parsers that read folders, one per process.
inline const std::filesystem::path& ScratchFolder() {
  static const std::filesystem::path folder = [] {
    const std::filesystem::path path = "/dev/shm/vgtw-fuzz-" + std::to_string(::getpid());
    std::filesystem::create_directories(path);
    std::atexit([] {
      std::error_code ignored;
      std::filesystem::remove_all(ScratchFolder(), ignored);
    });
    return path;
  }();
  return folder;
}

}  // namespace vgtw
