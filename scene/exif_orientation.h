// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"
#include "scene/view.h"

#include <cstddef>
#include <filesystem>
#include <span>

namespace vgtw {

// EXIF's Orientation says how stored pixels are turned to stand upright: 1 not at all, 3 by 180
// deg, 6 by 90 deg clockwise, 8 by 90 deg counter-clockwise; 2, 4, 5 and 7 are mirrored. COLMAP,
// and all of this project, works with the stored pixels; some other tools with the upright ones.

// The tag in the APP1 payload of a JPEG (see FindExif); 1 if it is absent or not in [1,8]. Defined
// for any bytes.
int ParseExifOrientation(std::span<const std::byte> exif);

// The same of a file; 1 for other formats than JPEG. Throws Error if the file is missing.
int ReadExifOrientation(const std::filesystem::path& path);

// Size of an image when it stands upright; `orientation` in [1,8].
ImageSize UprightSize(int orientation, const ImageSize& stored_size);

// Exact: takes pixels to pixels.
PixelMap UprightFromStored(int orientation, const ImageSize& stored_size);

}  // namespace vgtw
