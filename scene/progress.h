// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>

namespace vgtw {

// Called by long work after each unit: `done` of `total` units. May be empty. Called by one thread
// at a time.
using ProgressCallback = std::function<void(int64_t done, int64_t total)>;

}  // namespace vgtw
