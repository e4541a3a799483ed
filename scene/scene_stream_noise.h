// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace vgtw {

// FractalNoise of synthetic textures out of a table that repeats mirrored, five times as fast:
// zero on the average, rarely beyond [-1,1], detail below `footprint` left out; (u, v) and
// footprint in units in which the largest cells measure 0.8. Seeds differ by the place in the
// table.
float TableNoise(float u, float v, float footprint, uint32_t seed);

}  // namespace vgtw
