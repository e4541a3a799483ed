// SPDX-License-Identifier: BSD-3-Clause
#include "scene/exif_orientation.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/image_header.h"

#include <memory>
#include <string>

#include <libexif/exif-data.h>

namespace vgtw {

int ParseExifOrientation(std::span<const std::byte> exif) {
  constexpr int kUpright = 1;
  if (exif.empty()) return kUpright;
  const std::unique_ptr<ExifData, decltype(&exif_data_unref)> data(
      exif_data_new_from_data(reinterpret_cast<const unsigned char*>(exif.data()),
                              static_cast<unsigned int>(exif.size())),
      &exif_data_unref);
  if (!data) return kUpright;
  const ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_0], EXIF_TAG_ORIENTATION);
  if (entry == nullptr || entry->data == nullptr || entry->format != EXIF_FORMAT_SHORT ||
      entry->components < 1 || entry->size < exif_format_get_size(entry->format)) {
    return kUpright;
  }
  const int orientation = exif_get_short(entry->data, exif_data_get_byte_order(data.get()));
  return orientation >= 1 && orientation <= 8 ? orientation : kUpright;
}

int ReadExifOrientation(const std::filesystem::path& path) {
  const MappedFile file(path);
  return ParseExifOrientation(FindExif(file.bytes()));
}

ImageSize UprightSize(int orientation, const ImageSize& stored_size) {
  if (orientation < 5) return stored_size;
  return {stored_size.height, stored_size.width};
}

PixelMap UprightFromStored(int orientation, const ImageSize& stored_size) {
  VGTW_CHECK(orientation >= 1 && orientation <= 8, std::to_string(orientation));
  const auto w = static_cast<double>(stored_size.width);
  const auto h = static_cast<double>(stored_size.height);
  PixelMap map;
  switch (orientation) {
    case 2:
      map << -1, 0, w, 0, 1, 0;
      break;
    case 3:
      map << -1, 0, w, 0, -1, h;
      break;
    case 4:
      map << 1, 0, 0, 0, -1, h;
      break;
    case 5:
      map << 0, 1, 0, 1, 0, 0;
      break;
    case 6:
      map << 0, -1, h, 1, 0, 0;
      break;
    case 7:
      map << 0, -1, h, -1, 0, w;
      break;
    case 8:
      map << 0, 1, 0, -1, 0, w;
      break;
    default:
      map = IdentityPixelMap();
  }
  return map;
}

}  // namespace vgtw
