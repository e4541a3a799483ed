// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/error.h"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <type_traits>
#include <utility>

namespace vgtw {

static_assert(std::endian::native == std::endian::little, "files are little-endian");

// Reads little-endian values one after the other from foreign bytes of any alignment. Whatever does
// not fit into the bytes that are left throws Error with the file and the position.
class ByteReader {
 public:
  ByteReader(std::span<const std::byte> bytes, std::filesystem::path path)
      : bytes_(bytes), path_(std::move(path)) {}

  size_t NumBytesLeft() const { return bytes_.size() - position_; }

  template <typename T>
  requires std::is_arithmetic_v<T> T Read() {
    T value;
    std::memcpy(&value, Take(sizeof(T)).data(), sizeof(T));
    return value;
  }

  std::span<const std::byte> Take(size_t num_bytes) {
    if (num_bytes > NumBytesLeft()) {
      vgtw::Fail(path_,
                 "ends at byte " + std::to_string(bytes_.size()),
                 "the rest of a record that needs " + std::to_string(num_bytes) +
                     " bytes from byte " + std::to_string(position_),
                 kHint);
    }
    const auto taken = bytes_.subspan(position_, num_bytes);
    position_ += num_bytes;
    return taken;
  }

  // The characters before the next zero byte.
  std::string ReadCString() {
    const auto left = bytes_.subspan(position_);
    const void* end = left.empty() ? nullptr : std::memchr(left.data(), 0, left.size());
    if (end == nullptr) Take(left.size() + 1);
    const auto length = static_cast<size_t>(static_cast<const std::byte*>(end) - left.data());
    const auto text = Take(length + 1);
    return {reinterpret_cast<const char*>(text.data()), length};
  }

  // A count of records of at least `min_record_bytes` (> 0) each, so that the caller can allocate.
  template <typename T>
  size_t ReadCount(size_t min_record_bytes) {
    const size_t position = position_;
    const T count = Read<T>();
    if (count > NumBytesLeft() / min_record_bytes) {
      vgtw::Fail(
          path_,
          "announces " + std::to_string(count) + " records at byte " + std::to_string(position),
          "at most the " + std::to_string(NumBytesLeft() / min_record_bytes) +
              " that the file can hold",
          kHint);
    }
    return static_cast<size_t>(count);
  }

  void ExpectEnd() const {
    if (NumBytesLeft() == 0) return;
    vgtw::Fail(path_,
               "has " + std::to_string(NumBytesLeft()) + " bytes after the last record",
               "none",
               kHint);
  }

 private:
  static constexpr std::string_view kHint =
      "the file is truncated or damaged: copy or write it again";

  std::span<const std::byte> bytes_;
  std::filesystem::path path_;
  size_t position_ = 0;
};

}  // namespace vgtw
