// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// Tags of a photo's EXIF; what is not set is left out.
struct ExifTags {
  using Rational = std::array<uint32_t, 2>;  // numerator, denominator
  std::optional<uint32_t> orientation = {};
  std::optional<Rational> focal_length_mm = {};
  std::optional<uint32_t> focal_length_35mm = {};
  std::optional<uint32_t> pixel_x_dimension = {};
  std::optional<Rational> focal_plane_x_resolution = {};
  std::optional<uint32_t> focal_plane_resolution_unit = {};
};

// An APP1 payload "Exif\0\0" with a little-endian TIFF directory, as in the EXIF 2.3 standard.
inline std::string MakeExif(const ExifTags& tags) {
  const auto little_endian = [](uint32_t value, int num_bytes) {
    std::string bytes;
    for (int i = 0; i < num_bytes; ++i) bytes.push_back(static_cast<char>(value >> (8 * i) & 0xff));
    return bytes;
  };
  constexpr int kShort = 3;
  constexpr int kLong = 4;
  constexpr int kRational = 5;
  struct Entry {
    uint32_t tag;
    int format;
    std::array<uint32_t, 2> value;
  };
  const auto directory = [&](const std::vector<Entry>& entries, uint32_t offset) {
    std::string body = little_endian(static_cast<uint32_t>(entries.size()), 2);
    std::string data;
    const auto data_offset = offset + 2 + 12 * static_cast<uint32_t>(entries.size()) + 4;
    for (const Entry& entry : entries) {
      body += little_endian(entry.tag, 2) + little_endian(static_cast<uint32_t>(entry.format), 2) +
              little_endian(1, 4);
      if (entry.format == kRational) {
        body += little_endian(data_offset + static_cast<uint32_t>(data.size()), 4);
        data += little_endian(entry.value[0], 4) + little_endian(entry.value[1], 4);
      } else {
        body += little_endian(entry.value[0], 4);  // a SHORT fills the first two bytes
      }
    }
    return body + little_endian(0, 4) + data;
  };
  std::vector<Entry> photo;  // ascending tags
  if (tags.focal_length_mm) photo.push_back({0x920a, kRational, *tags.focal_length_mm});
  if (tags.pixel_x_dimension) photo.push_back({0xa002, kLong, {*tags.pixel_x_dimension}});
  if (tags.focal_plane_x_resolution) {
    photo.push_back({0xa20e, kRational, *tags.focal_plane_x_resolution});
  }
  if (tags.focal_plane_resolution_unit) {
    photo.push_back({0xa210, kShort, {*tags.focal_plane_resolution_unit}});
  }
  if (tags.focal_length_35mm) photo.push_back({0xa405, kShort, {*tags.focal_length_35mm}});
  std::vector<Entry> main;
  if (tags.orientation) main.push_back({0x0112, kShort, {*tags.orientation}});
  main.push_back({0x8769, kLong, {0}});
  constexpr uint32_t kHeaderSize = 8;
  const uint32_t main_size = 2 + 12 * static_cast<uint32_t>(main.size()) + 4;
  main.back().value[0] = kHeaderSize + main_size;
  return std::string("Exif\0\0II*\0", 10) + little_endian(kHeaderSize, 4) +
         directory(main, kHeaderSize) + directory(photo, kHeaderSize + main_size);
}

// The bytes of a JPEG with this APP1 payload right behind its start marker.
inline std::string InsertExif(const std::string& jpeg, const std::string& exif) {
  const size_t length = exif.size() + 2;
  const std::string segment = {
      '\xff', '\xe1', static_cast<char>(length >> 8), static_cast<char>(length & 0xff)};
  return jpeg.substr(0, 2) + segment + exif + jpeg.substr(2);
}

}  // namespace vgtw
