// SPDX-License-Identifier: BSD-3-Clause
#include "scene/error.h"

#include <cerrno>
#include <cstring>

namespace vgtw {

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
  std::string printable(text.substr(0, kMaxLength));
  for (char& c : printable) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) c = '?';
  }
  if (text.size() > kMaxLength) printable += "...";
  return printable;
}

}  // namespace vgtw
