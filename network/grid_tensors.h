// SPDX-License-Identifier: BSD-3-Clause
// Pixels as tensors. Internal to network/: needs LibTorch.
#pragma once

#include "scene/grid.h"
#include "scene/image_io.h"

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace vgtw {

// [3, H, W] in [0, 1].
at::Tensor ToTensor(const RgbImage& image);

// [H, W], copies.
at::Tensor ToTensor(const Grid<float>& map);
at::Tensor ToTensor(const Grid<uint8_t>& map);

}  // namespace vgtw
