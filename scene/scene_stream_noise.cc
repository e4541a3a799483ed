// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_noise.h"

#include "scene/grid.h"
#include "scene/synthetic_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vgtw {
namespace {

constexpr int kSide = 256;          // cells of the finest level, a power of two
constexpr int kNumLevels = 9;       // down to one cell
constexpr float kCellSize = 0.05f;  // of the finest level

using Levels = std::array<Grid<float>, kNumLevels>;

Levels MakeLevels() {
  Levels levels;
  levels[0] = Grid<float>(kSide, kSide);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      levels[0](x, y) = FractalNoise({x * kCellSize, y * kCellSize}, kCellSize, 1);
    }
  }
  for (size_t i = 1; i < levels.size(); ++i) {
    const Grid<float>& finer = levels[i - 1];
    levels[i] = Grid<float>(finer.width() / 2, finer.height() / 2);
    for (int y = 0; y < levels[i].height(); ++y) {
      for (int x = 0; x < levels[i].width(); ++x) {
        levels[i](x, y) = 0.25f * (finer(2 * x, 2 * y) + finer(2 * x + 1, 2 * y) +
                                   finer(2 * x, 2 * y + 1) + finer(2 * x + 1, 2 * y + 1));
      }
    }
  }
  return levels;
}

// Index of a table of 2^n cells that repeats mirrored.
int Mirror(int index, int side) {
  const int folded = index & (2 * side - 1);
  return folded < side ? folded : 2 * side - 1 - folded;
}

// std::floor is a call on the oldest x86-64.
int Floor(float x) {
  const auto truncated = static_cast<int>(x);
  return truncated - (static_cast<float>(truncated) > x ? 1 : 0);
}

// (u, v) in cells of the finest level.
float LookUp(const Levels& levels, float u, float v, float footprint) {
  const int level_idx = std::clamp(std::ilogb(1.4142f * footprint), 0, kNumLevels - 1);
  const Grid<float>& level = levels[static_cast<size_t>(level_idx)];
  const int side = level.width();
  const float scale = 1.0f / static_cast<float>(1 << level_idx);
  const float x = u * scale - 0.5f;
  const float y = v * scale - 0.5f;
  const int column = Floor(x);
  const int row = Floor(y);
  const float wx = x - static_cast<float>(column);
  const float wy = y - static_cast<float>(row);
  const int x0 = Mirror(column, side);
  const int x1 = Mirror(column + 1, side);
  const int y0 = Mirror(row, side);
  const int y1 = Mirror(row + 1, side);
  const float top = level(x0, y0) + wx * (level(x1, y0) - level(x0, y0));
  const float bottom = level(x0, y1) + wx * (level(x1, y1) - level(x0, y1));
  return top + wy * (bottom - top);
}

}  // namespace

float TableNoise(float u, float v, float footprint, uint32_t seed) {
  static const Levels levels = MakeLevels();
  const float cells_u = u / kCellSize + static_cast<float>(seed & 511u);
  const float cells_v = v / kCellSize + static_cast<float>(seed >> 9 & 511u);
  const float cells_footprint = std::max(footprint / kCellSize, 1e-3f);
  const float noise = LookUp(levels, cells_u, cells_v, cells_footprint);
  if (cells_footprint >= 0.5f) return noise;
  // Close by, the table alone would look smooth.
  constexpr float kFiner = 8.0f;
  constexpr float kAmplitude = 0.3f;
  return noise + kAmplitude * (1.0f - 2.0f * cells_footprint) *
                     LookUp(levels, kFiner * cells_u, kFiner * cells_v, kFiner * cells_footprint);
}

}  // namespace vgtw
