// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/image_io.h"
#include "scene/view.h"

namespace vgtw {

ImageSize SizeOf(const StaticMask& static_mask);

// (x, y) -> (x_factor * x, y_factor * y)
PixelMap ScaleMap(double x_factor, double y_factor);

PixelMap Compose(const PixelMap& c_from_b, const PixelMap& b_from_a);

// The nearest pixel of `static_mask` under each centre of an image of `size`; kept outside of it.
StaticMask Resample(const StaticMask& static_mask, const PixelMap& mask_from_out, ImageSize size);

// Whether both sides are scaled alike, but for cutting or rounding each to whole pixels.
bool IsScaled(const ImageSize& mask, const ImageSize& photo);

// 0 becomes 255 and the other way round.
void Invert(StaticMask& static_mask);

}  // namespace vgtw
