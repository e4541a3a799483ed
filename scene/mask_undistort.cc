// SPDX-License-Identifier: BSD-3-Clause
#include "scene/mask_undistort.h"

#include "scene/error.h"

#include <algorithm>
#include <optional>

namespace vgtw {
namespace {

// Index of the pixel of a row of `size` pixels that holds `position`; nullopt beyond the outermost
// centres. The margin lets equal cameras meet those centres in spite of rounding.
std::optional<int> PixelIndex(double position, int size) {
  constexpr double kMarginPx = 1e-6;
  if (!(position >= 0.5 - kMarginPx && position <= size - 0.5 + kMarginPx)) return std::nullopt;
  return std::clamp(static_cast<int>(position), 0, size - 1);
}

uint8_t Lookup(const StaticMask& static_mask, const Eigen::Vector2d& pixel) {
  const std::optional<int> x = PixelIndex(pixel.x(), static_mask.width());
  const std::optional<int> y = PixelIndex(pixel.y(), static_mask.height());
  return x && y ? static_mask(*x, *y) : uint8_t{0};
}

}  // namespace

StaticMask UndistortMask(const StaticMask& static_mask,
                         const Camera& distorted,
                         const Camera& undistorted) {
  VGTW_CHECK(static_cast<uint64_t>(static_mask.width()) == distorted.width &&
                 static_cast<uint64_t>(static_mask.height()) == distorted.height,
             "mask has the distorted camera's size");
  StaticMask result(static_cast<int>(undistorted.width), static_cast<int>(undistorted.height), 0);
  for (int y = 0; y < result.height(); ++y) {
    for (int x = 0; x < result.width(); ++x) {
      const auto ray = Unproject(undistorted, {x + 0.5, y + 0.5});
      if (!ray) continue;
      const auto pixel = Project(distorted, ray->homogeneous());
      if (pixel) result(x, y) = Lookup(static_mask, *pixel);
    }
  }
  return result;
}

}  // namespace vgtw
