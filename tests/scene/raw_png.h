// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace vgtw {

inline std::string BigEndianBytes(uint32_t value) {
  return {static_cast<char>(value >> 24),
          static_cast<char>(value >> 16),
          static_cast<char>(value >> 8),
          static_cast<char>(value)};
}

// One chunk with its CRC-32 (PNG specification, annex D).
inline std::string PngChunk(const std::string& type, const std::string& data) {
  uint32_t crc = 0xffffffffu;
  for (const char c : type + data) {
    crc ^= static_cast<uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
  }
  return BigEndianBytes(static_cast<uint32_t>(data.size())) + type + data + BigEndianBytes(~crc);
}

// A PNG of any colour type, which the library under test cannot write. `rows` are the image's
// packed rows, each after a filter byte 0, at most 65535 bytes; `extra_chunks` stand before them
// (palette).
inline std::string MakePng(uint32_t width,
                           uint32_t height,
                           int bit_depth,
                           int colour_type,
                           const std::string& rows,
                           const std::string& extra_chunks = {}) {
  uint32_t a = 1;
  uint32_t b = 0;
  for (const char c : rows) {
    a = (a + static_cast<uint8_t>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const auto size = static_cast<uint32_t>(rows.size());
  const auto low_byte = [](uint32_t value) { return static_cast<char>(value & 0xff); };
  // A zlib stream of one stored block.
  const std::string zlib = std::string{'\x78',
                                       '\x01',
                                       '\x01',
                                       low_byte(size),
                                       low_byte(size >> 8),
                                       low_byte(~size),
                                       low_byte(~size >> 8)} +
                           rows + BigEndianBytes(b << 16 | a);
  const std::string header =
      BigEndianBytes(width) + BigEndianBytes(height) +
      std::string{static_cast<char>(bit_depth), static_cast<char>(colour_type), '\0', '\0', '\0'};
  return "\x89PNG\r\n\x1a\n" + PngChunk("IHDR", header) + extra_chunks + PngChunk("IDAT", zlib) +
         PngChunk("IEND", "");
}

}  // namespace vgtw
