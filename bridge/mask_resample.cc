// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_resample.h"

#include <algorithm>
#include <cmath>

namespace vgtw {

ImageSize SizeOf(const StaticMask& static_mask) {
  return {static_cast<uint64_t>(static_mask.width()), static_cast<uint64_t>(static_mask.height())};
}

PixelMap ScaleMap(double x_factor, double y_factor) {
  PixelMap map;
  map << x_factor, 0, 0, 0, y_factor, 0;
  return map;
}

PixelMap Compose(const PixelMap& c_from_b, const PixelMap& b_from_a) {
  PixelMap c_from_a = c_from_b.leftCols<2>() * b_from_a;
  c_from_a.col(2) += c_from_b.col(2);
  return c_from_a;
}

StaticMask Resample(const StaticMask& static_mask, const PixelMap& mask_from_out, ImageSize size) {
  if (size == SizeOf(static_mask) && mask_from_out == IdentityPixelMap()) return static_mask;
  StaticMask out(static_cast<int>(size.width), static_cast<int>(size.height), 255);
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      const Eigen::Vector2d pixel = Apply(mask_from_out, {x + 0.5, y + 0.5});
      const int mask_x = static_cast<int>(std::floor(pixel.x()));
      const int mask_y = static_cast<int>(std::floor(pixel.y()));
      if (static_mask.Contains(mask_x, mask_y)) out(x, y) = static_mask(mask_x, mask_y);
    }
  }
  return out;
}

bool IsScaled(const ImageSize& mask, const ImageSize& photo) {
  // Cutting or rounding moves this difference of products by at most the longer side.
  const double difference = static_cast<double>(mask.width) * static_cast<double>(photo.height) -
                            static_cast<double>(mask.height) * static_cast<double>(photo.width);
  return std::abs(difference) <= static_cast<double>(std::max(photo.width, photo.height));
}

void Invert(StaticMask& static_mask) {
  for (uint8_t& value : static_mask.data()) value = static_cast<uint8_t>(255 - value);
}

}  // namespace vgtw
