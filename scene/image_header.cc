// SPDX-License-Identifier: BSD-3-Clause
#include "scene/image_header.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace vgtw {
namespace {

using Bytes = std::span<const std::byte>;

uint32_t BigEndian(Bytes bytes, size_t offset, size_t num_bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < num_bytes; ++i) {
    value = value << 8 | std::to_integer<uint32_t>(bytes[offset + i]);
  }
  return value;
}

bool StartsWith(Bytes bytes, std::string_view prefix) {
  return bytes.size() >= prefix.size() &&
         std::memcmp(bytes.data(), prefix.data(), prefix.size()) == 0;
}

constexpr std::string_view kJpegSignature = "\xff\xd8\xff";
constexpr std::string_view kPngSignature = "\x89PNG\r\n\x1a\n";
constexpr std::string_view kExifSignature{"Exif\0\0", 6};

constexpr uint8_t kEndOfImage = 0xd9;
constexpr uint8_t kApp1 = 0xe1;

struct JpegSegment {
  uint8_t marker = 0;
  Bytes payload;  // without the length; empty for EOI
};

// Walks the segments of a JPEG. Entropy-coded data between them is stepped over, since a marker
// cannot occur inside it.
class JpegWalker {
 public:
  explicit JpegWalker(Bytes file) : rest_(file.subspan(kJpegSignature.size() - 1)) {}

  std::optional<JpegSegment> Next() {
    while (rest_.size() >= 2) {
      const auto found = std::find(rest_.begin(), rest_.end() - 1, std::byte{0xff});
      rest_ = rest_.subspan(static_cast<size_t>(found - rest_.begin()));
      if (rest_.size() < 2) break;
      const auto marker = std::to_integer<uint8_t>(rest_[1]);
      if (marker == 0xff) {
        rest_ = rest_.subspan(1);
        continue;
      }
      rest_ = rest_.subspan(2);
      if (marker == kEndOfImage) return JpegSegment{marker, {}};
      if (!HasPayload(marker)) continue;
      if (rest_.size() < 2) break;
      const size_t length = BigEndian(rest_, 0, 2);  // counts its own two bytes
      if (length < 2 || length > rest_.size()) break;
      const JpegSegment segment{marker, rest_.subspan(2, length - 2)};
      rest_ = rest_.subspan(length);
      return segment;
    }
    return std::nullopt;
  }

 private:
  // 00 is a stuffed byte, 01 TEM, d0..d7 restarts, d8 SOI.
  static bool HasPayload(uint8_t marker) {
    return marker > 0x01 && !(marker >= 0xd0 && marker <= 0xd8);
  }

  Bytes rest_;
};

bool IsFrameHeader(uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<ImageSize> NonZero(uint64_t width, uint64_t height) {
  if (width == 0 || height == 0) return std::nullopt;
  return ImageSize{width, height};
}

std::optional<ImageSize> ParseJpegSize(Bytes file) {
  JpegWalker walker(file);
  while (const auto segment = walker.Next()) {
    if (segment->marker == kEndOfImage) break;
    if (!IsFrameHeader(segment->marker)) continue;
    if (segment->payload.size() < 5) break;
    return NonZero(BigEndian(segment->payload, 3, 2), BigEndian(segment->payload, 1, 2));
  }
  return std::nullopt;
}

// Width and height (u32), bit depth, colour type, ...; empty for other files.
Bytes FindPngHeader(Bytes file) {
  constexpr size_t kNumBytes = 13;
  if (!StartsWith(file, kPngSignature)) return {};
  const Bytes chunk = file.subspan(kPngSignature.size());
  if (chunk.size() < 8 + kNumBytes || !StartsWith(chunk.subspan(4), "IHDR")) return {};
  return chunk.subspan(8, kNumBytes);
}

std::optional<ImageSize> ParsePngSize(Bytes file) {
  const Bytes header = FindPngHeader(file);
  if (header.empty()) return std::nullopt;
  return NonZero(BigEndian(header, 0, 4), BigEndian(header, 4, 4));
}

bool JpegHasEnd(Bytes file) {
  JpegWalker walker(file);
  while (const auto segment = walker.Next()) {
    if (segment->marker == kEndOfImage) return true;
  }
  return false;
}

bool PngHasEnd(Bytes file) {
  constexpr size_t kChunkFrame = 12;  // length, type, CRC
  Bytes rest = file.subspan(kPngSignature.size());
  while (rest.size() >= kChunkFrame) {
    const size_t length = BigEndian(rest, 0, 4);
    if (length > rest.size() - kChunkFrame) return false;
    if (StartsWith(rest.subspan(4), "IEND")) return true;
    rest = rest.subspan(length + kChunkFrame);
  }
  return false;
}

}  // namespace

std::optional<ImageSize> ParseImageSize(Bytes file) {
  if (StartsWith(file, kJpegSignature)) return ParseJpegSize(file);
  if (StartsWith(file, kPngSignature)) return ParsePngSize(file);
  return std::nullopt;
}

std::optional<PngFormat> ParsePngFormat(Bytes file) {
  constexpr size_t kBitDepth = 8;  // offsets in the header
  constexpr size_t kColour = 9;
  const Bytes header = FindPngHeader(file);
  if (header.empty()) return std::nullopt;
  const auto bit_depth = std::to_integer<int>(header[kBitDepth]);
  const auto colour = std::to_integer<int>(header[kColour]);
  const bool is_depth =
      bit_depth == 1 || bit_depth == 2 || bit_depth == 4 || bit_depth == 8 || bit_depth == 16;
  const bool is_colour = colour == 0 || colour == 2 || colour == 3 || colour == 4 || colour == 6;
  if (!is_depth || !is_colour) return std::nullopt;
  return PngFormat{bit_depth, static_cast<PngColour>(colour)};
}

bool HasAlphaForPython(Bytes file) {
  const auto format = ParsePngFormat(file);
  if (!format) return false;
  return format->colour == PngColour::kRgbWithAlpha ||
         (format->colour == PngColour::kGrayWithAlpha && format->bit_depth == 16);
}

bool IsTruncated(Bytes file) {
  if (StartsWith(file, kJpegSignature)) return !JpegHasEnd(file);
  if (StartsWith(file, kPngSignature)) return !PngHasEnd(file);
  return false;
}

Bytes FindExif(Bytes file) {
  if (!StartsWith(file, kJpegSignature)) return {};
  constexpr uint8_t kStartOfScan = 0xda;
  JpegWalker walker(file);
  while (const auto segment = walker.Next()) {
    if (segment->marker == kStartOfScan || segment->marker == kEndOfImage) break;
    if (segment->marker == kApp1 && StartsWith(segment->payload, kExifSignature)) {
      return segment->payload;
    }
  }
  return {};
}

}  // namespace vgtw
