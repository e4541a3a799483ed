// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <cstddef>
#include <optional>
#include <span>

namespace vgtw {

// Focal length in pixels by the rule of ReadExifFocalLength, from the APP1 payload of a JPEG (see
// FindExif; empty gives nullopt) and the size of the stored image. Defined for any bytes.
std::optional<double> ParseExifFocalLength(std::span<const std::byte> exif, const ImageSize& size);

}  // namespace vgtw
