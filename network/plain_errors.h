// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "scene/error.h"

#include <string>

#include <c10/util/Exception.h>

namespace vgtw {

// work(), with LibTorch's exceptions as Error: their messages are a line, then a stack. `advice` is
// for when memory does not suffice.
template <typename Work>
auto WithPlainErrors(const Work& work, const char* advice) {
  try {
    return work();
  } catch (const c10::Error& error) {
    const std::string text = error.what_without_backtrace();
    const bool is_memory = text.find("memory") != std::string::npos;
    throw Error("LibTorch: " + text.substr(0, text.find('\n')) + (is_memory ? advice : ""));
  }
}

}  // namespace vgtw
