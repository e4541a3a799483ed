// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
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
// packed rows, each after a filter byte 0; `extra_chunks` stand before them (palette).
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
  const auto low_byte = [](size_t value) { return static_cast<char>(value & 0xff); };
  // A zlib stream of stored blocks.
  std::string zlib = "\x78\x01";
  constexpr size_t kMaxBlock = 65535;
  for (size_t begin = 0; begin == 0 || begin < rows.size(); begin += kMaxBlock) {
    const size_t size = std::min(kMaxBlock, rows.size() - begin);
    const bool is_last = begin + size == rows.size();
    zlib += {is_last ? '\1' : '\0',
             low_byte(size),
             low_byte(size >> 8),
             low_byte(~size),
             low_byte(~size >> 8)};
    zlib += rows.substr(begin, size);
  }
  zlib += BigEndianBytes(b << 16 | a);
  const std::string header =
      BigEndianBytes(width) + BigEndianBytes(height) +
      std::string{static_cast<char>(bit_depth), static_cast<char>(colour_type), '\0', '\0', '\0'};
  return "\x89PNG\r\n\x1a\n" + PngChunk("IHDR", header) + extra_chunks + PngChunk("IDAT", zlib) +
         PngChunk("IEND", "");
}

}  // namespace vgtw
