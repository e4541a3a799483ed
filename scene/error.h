// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace vgtw {

// The world is wrong (a file, a database, a subprocess): what() is one line that tells what was
// found, what was expected and what to do. `main` prints it and exits with 1.
// A broken contract between pieces of code is std::invalid_argument (VGTW_CHECK); an outcome that
// may happen (no convergence, too few points) is a return value.
class Error : public std::runtime_error {
 public:
  // Control characters and invalid bytes, which foreign names may hold, become '?'.
  explicit Error(std::string_view line);
};

// Throws Error "<path>: <found>, expected <expected>; <hint>". `hint` may be empty.
[[noreturn]] void Fail(const std::filesystem::path& path,
                       std::string_view found,
                       std::string_view expected,
                       std::string_view hint = {});

// Throws Error "<path>: <what>: <text of errno>".
[[noreturn]] void FailErrno(const std::filesystem::path& path, std::string_view what);

// `text` with control characters and invalid bytes replaced by '?', cut after 200 bytes: for
// quoting foreign bytes of any length.
std::string Printable(std::string_view text);

}  // namespace vgtw

// Throws std::invalid_argument with `message` unless `condition` holds.
#define VGTW_CHECK(condition, message)                                                \
  do {                                                                                \
    if (!(condition)) {                                                               \
      throw std::invalid_argument(std::string(#condition " violated: ") + (message)); \
    }                                                                                 \
  } while (false)
