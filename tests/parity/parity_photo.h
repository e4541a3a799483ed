// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"
#include "tests/parity/parity_formula.h"

#include <cstddef>
#include <cstdint>
#include <string>

namespace vgtw {

// An image of three planes, as networks take it.
template <typename Bytes>
RgbImage FromPlanes(const Bytes& planes, int width, int height) {
  RgbImage image(width, height);
  for (size_t i = 0; i < image.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) {
      image.data()[i][c] = static_cast<uint8_t>(planes[c * image.size() + i]);
    }
  }
  return image;
}

// A photo made by the formula.
inline RgbImage ParityPhoto(const std::string& name, int width, int height) {
  return FromPlanes(ParityPixels(name, 1, height, width), width, height);
}

}  // namespace vgtw
