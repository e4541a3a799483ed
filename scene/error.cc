// SPDX-License-Identifier: BSD-3-Clause
#include "scene/error.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>

namespace vgtw {
namespace {

// Bytes of the UTF-8 character at the start of `text`; 0 if there is none.
size_t Utf8Length(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80) return 1;
  const size_t length = byte(0) >= 0xf0 ? 4 : byte(0) >= 0xe0 ? 3 : 2;
  if (byte(0) < 0xc2 || byte(0) > 0xf4 || text.size() < length) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  // Overlong forms, surrogates and what lies beyond U+10FFFF are told by the second byte.
  const unsigned second = byte(1);
  const bool is_bad = (byte(0) == 0xe0 && second < 0xa0) || (byte(0) == 0xed && second > 0x9f) ||
                      (byte(0) == 0xf0 && second < 0x90) || (byte(0) == 0xf4 && second > 0x8f);
  return is_bad ? 0 : length;
}

// Replaces control characters and invalid bytes by '?', and cuts after `max_length` bytes.
std::string OneLine(std::string_view text, size_t max_length) {
  std::string line;
  while (!text.empty() && line.size() < max_length) {
    const size_t length = Utf8Length(text);
    const auto byte = static_cast<unsigned char>(text.front());
    if (length == 0 || byte < 0x20 || byte == 0x7f) {
      line += '?';
    } else {
      line += text.substr(0, length);
    }
    text.remove_prefix(std::max<size_t>(length, 1));
  }
  if (!text.empty()) line += "...";
  return line;
}

}  // namespace

Error::Error(std::string_view line)
    : std::runtime_error(OneLine(line, std::numeric_limits<size_t>::max())) {}

void Fail(const std::filesystem::path& path,
          std::string_view found,
          std::string_view expected,
          std::string_view hint) {
  std::string message = Printable(path.string());
  message.append(": ").append(found).append(", expected ").append(expected);
  if (!hint.empty()) message.append("; ").append(hint);
  throw Error(message);
}

void FailErrno(const std::filesystem::path& path, std::string_view what) {
  const int code = errno;
  throw Error(Printable(path.string()) + ": " + std::string(what) + ": " + std::strerror(code));
}

std::string Printable(std::string_view text) {
  constexpr size_t kMaxLength = 200;
  return OneLine(text, kMaxLength);
}

}  // namespace vgtw
