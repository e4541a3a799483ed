// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace vgtw {

inline constexpr double kGib = 1024.0 * 1024.0 * 1024.0;

// All in bytes.

// Memory of the machine; 0 where it cannot be told.
int64_t TotalMemory();

// What this process may still take: what the machine has free, or less if the control group of the
// process allows less.
int64_t AvailableMemory();

// Largest resident size that this process ever had; mapped files count.
int64_t PeakMemory();

// Its resident size now.
int64_t ResidentMemory();

}  // namespace vgtw
