// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include <string>

#include <c10/core/Device.h>

namespace vgtw {

// "cpu", "cuda" or "cuda:<number>". Throws Error for other words, or if there is no such GPU.
at::Device ParseDevice(const std::string& text);

}  // namespace vgtw
