// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

namespace vgtw {

// The antialiased resize of the Python imaging library (Pillow), which the official loaders of the
// networks use: the same bytes. With s = old size / new size and f = max(s, 1), along each axis
//   new[i] = sum_j w_ij old[j],   w_ij ~ kernel((j + 0.5 - (i + 0.5) s) / f),   sum_j w_ij = 1,
// columns first, each axis rounded to 8 bits. An axis that keeps its size is left alone.
enum class PilFilter {
  kBicubic,  // the cubic with a = -0.5, 2 wide on each side
  kLanczos   // sinc(x) sinc(x / 3), 3 wide on each side
};

struct PilResizeOptions {
  PilFilter filter = PilFilter::kBicubic;
  // The rows of the resized image that are wanted; only they are computed.
  int first_row = 0;
  int num_rows = -1;  // -1 = all from first_row on
  int num_threads = 1;
};

// Rows of `image` resized to `width` columns and `height` rows. Throws std::invalid_argument if a
// size is empty, an axis shrinks more than 512-fold, the wanted rows do not exist, or if the result
// of one of the axes has more than 2^30 pixels.
RgbImage PilResize(const RgbImage& image,
                   int width,
                   int height,
                   const PilResizeOptions& options = {});

}  // namespace vgtw
