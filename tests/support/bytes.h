// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/error.h"

#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include <gtest/gtest.h>

namespace vgtw {

// The little-endian bytes of some values, one after the other; strings as they are.
inline std::string Bytes() { return {}; }
template <typename T, typename... Rest>
std::string Bytes(const T& value, const Rest&... rest) {
  if constexpr (std::is_arithmetic_v<T>) {
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    return bytes + Bytes(rest...);
  } else {
    return std::string(value) + Bytes(rest...);
  }
}

inline std::span<const std::byte> AsBytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}

// The text of the vgtw::Error that `work` throws, "" if it throws none. Errors are one line.
template <typename Work>
std::string ErrorOf(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    EXPECT_FALSE(text.empty());
    return text;
  }
  return "";
}

}  // namespace vgtw
