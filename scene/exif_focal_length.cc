// SPDX-License-Identifier: BSD-3-Clause
#include "scene/exif_focal_length.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <memory>

#include <libexif/exif-data.h>

namespace vgtw {
namespace {

// A number of the Exif IFD, nullopt if absent or of another kind.
std::optional<double> ReadTag(ExifData* exif, ExifTag tag) {
  const ExifEntry* entry = exif_content_get_entry(exif->ifd[EXIF_IFD_EXIF], tag);
  if (entry == nullptr || entry->data == nullptr || entry->components < 1 ||
      entry->size < exif_format_get_size(entry->format)) {
    return std::nullopt;
  }
  const ExifByteOrder order = exif_data_get_byte_order(exif);
  if (entry->format == EXIF_FORMAT_SHORT) return exif_get_short(entry->data, order);
  if (entry->format == EXIF_FORMAT_LONG) return exif_get_long(entry->data, order);
  if (entry->format == EXIF_FORMAT_RATIONAL) {
    const ExifRational rational = exif_get_rational(entry->data, order);
    if (rational.denominator == 0) return std::nullopt;
    return static_cast<double>(rational.numerator) / rational.denominator;
  }
  return std::nullopt;
}

// Millimetres of EXIF's FocalPlaneResolutionUnit: inches and centimetres, as in COLMAP.
std::optional<double> ResolutionUnitMm(double unit) {
  if (unit == 2.0) return 25.4;
  if (unit == 3.0) return 10.0;
  return std::nullopt;
}

// COLMAP reads the focal length from text with one decimal.
double RoundToTenths(double value) {
  std::array<char, 32> text;
  const auto written =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, 1);
  double rounded = 0.0;
  std::from_chars(text.data(), written.ptr, rounded);
  return rounded;
}

// The sensor's width follows from PixelXDimension, not from the file's width, because the photo may
// have been resized with its EXIF kept.
std::optional<double> SensorWidthMm(ExifData* exif) {
  const auto pixels = ReadTag(exif, EXIF_TAG_PIXEL_X_DIMENSION);
  const auto resolution = ReadTag(exif, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
  const auto unit = ReadTag(exif, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT);
  if (!pixels || !resolution || !unit || *resolution <= 0.0) return std::nullopt;
  const auto unit_mm = ResolutionUnitMm(*unit);
  if (!unit_mm) return std::nullopt;
  return *pixels / *resolution * *unit_mm;
}

std::optional<double> FocalLengthPx(ExifData* exif, double longer_side) {
  constexpr double kFilmWidthMm = 35.0;  // COLMAP divides by 35, not by the 36 of the film
  const auto film_mm = ReadTag(exif, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (film_mm && *film_mm > 0.0) return *film_mm / kFilmWidthMm * longer_side;
  const auto focal_mm = ReadTag(exif, EXIF_TAG_FOCAL_LENGTH);
  const auto sensor_mm = SensorWidthMm(exif);
  if (!focal_mm || !sensor_mm || *sensor_mm <= 0.0) return std::nullopt;
  const double rounded_mm = RoundToTenths(*focal_mm);
  if (rounded_mm <= 0.0) return std::nullopt;
  return rounded_mm / *sensor_mm * longer_side;
}

}  // namespace

std::optional<double> ParseExifFocalLength(std::span<const std::byte> exif, const ImageSize& size) {
  if (exif.empty()) return std::nullopt;
  const std::unique_ptr<ExifData, decltype(&exif_data_unref)> data(exif_data_new(),
                                                                   &exif_data_unref);
  if (!data) return std::nullopt;
  // Otherwise libexif invents the tags that the standard demands.
  exif_data_unset_option(data.get(), EXIF_DATA_OPTION_FOLLOW_SPECIFICATION);
  exif_data_load_data(data.get(),
                      reinterpret_cast<const unsigned char*>(exif.data()),
                      static_cast<unsigned int>(exif.size()));
  const auto longer_side = static_cast<double>(std::max(size.width, size.height));
  return FocalLengthPx(data.get(), longer_side);
}

}  // namespace vgtw
