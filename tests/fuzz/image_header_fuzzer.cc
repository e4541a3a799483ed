// SPDX-License-Identifier: BSD-3-Clause
#include "scene/exif_focal_length.h"
#include "scene/exif_orientation.h"
#include "scene/gray_png.h"
#include "scene/image_header.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  const auto file = InputBytes(data, size);
  return OnlyErrors([&] {
    ParseImageSize(file);
    IsTruncated(file);
    const auto focal_length = ParseExifFocalLength(FindExif(file), {640, 480});
    Require(!focal_length || *focal_length > 0.0);
    const int orientation = ParseExifOrientation(FindExif(file));
    Require(orientation >= 1 && orientation <= 8);
    ParsePngFormat(file);
    const auto image = DecodeGrayPng(file);
    Require(!image || ImageSize{static_cast<uint64_t>(image->width()),
                                static_cast<uint64_t>(image->height())} == ParseImageSize(file));
  });
}
