// SPDX-License-Identifier: BSD-3-Clause
#include "scene/gray_png.h"

#include "scene/image_header.h"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

#include <libdeflate.h>

namespace vgtw {
namespace {

using Bytes = std::span<const std::byte>;

constexpr size_t kSignatureSize = 8;
constexpr size_t kHeaderSize = 13;
constexpr size_t kInterlaceByte = 12;

enum Filter : uint8_t { kNone = 0, kSub = 1, kUp = 2, kAverage = 3, kPaeth = 4 };

uint32_t BigEndian(Bytes bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | std::to_integer<uint32_t>(bytes[i]);
  return value;
}

struct Chunk {
  std::string_view type;
  Bytes data;
};

// Takes one chunk off the front; nullopt if it is cut or has another CRC than it says.
std::optional<Chunk> TakeChunk(Bytes& rest) {
  constexpr size_t kFrame = 12;  // length, type, CRC
  if (rest.size() < kFrame) return std::nullopt;
  const size_t size = BigEndian(rest);
  if (size > rest.size() - kFrame) return std::nullopt;
  const Bytes checked = rest.subspan(4, 4 + size);
  if (libdeflate_crc32(0, checked.data(), checked.size()) != BigEndian(rest.subspan(8 + size))) {
    return std::nullopt;
  }
  rest = rest.subspan(kFrame + size);
  return Chunk{{reinterpret_cast<const char*>(checked.data()), 4}, checked.subspan(4)};
}

bool IsCritical(const Chunk& chunk) { return (chunk.type[0] & 0x20) == 0; }

// The zlib stream of all IDAT chunks; nullopt if the file has others that change the pixels.
std::optional<std::vector<std::byte>> JoinImageData(Bytes file) {
  Bytes rest = file.subspan(kSignatureSize);
  const auto header = TakeChunk(rest);
  if (!header || header->type != "IHDR" || header->data.size() != kHeaderSize) return std::nullopt;
  for (size_t i = kInterlaceByte - 2; i <= kInterlaceByte; ++i) {
    if (header->data[i] != std::byte{0}) return std::nullopt;  // compression, filter, interlace
  }
  std::vector<std::byte> joined;
  bool is_behind = false;
  while (const auto chunk = TakeChunk(rest)) {
    if (chunk->type == "IEND") return joined;
    if (chunk->type == "IDAT") {
      if (is_behind) return std::nullopt;
      joined.insert(joined.end(), chunk->data.begin(), chunk->data.end());
    } else if (IsCritical(*chunk) || chunk->type == "tRNS") {
      return std::nullopt;
    } else {
      is_behind = !joined.empty();
    }
  }
  return std::nullopt;
}

bool Inflate(Bytes zlib, std::vector<uint8_t>& out) {
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)>
      decompressor(libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  if (decompressor == nullptr) throw std::bad_alloc();
  return libdeflate_zlib_decompress(
             decompressor.get(), zlib.data(), zlib.size(), out.data(), out.size(), nullptr) ==
         LIBDEFLATE_SUCCESS;
}

uint8_t Paeth(int left, int above, int above_left) {
  const int to_left = std::abs(above - above_left);
  const int to_above = std::abs(left - above_left);
  const int to_above_left = std::abs(left + above - 2 * above_left);
  if (to_left <= to_above && to_left <= to_above_left) return static_cast<uint8_t>(left);
  return static_cast<uint8_t>(to_above <= to_above_left ? above : above_left);
}

template <Filter filter>
uint8_t Predict(uint8_t left, uint8_t above, uint8_t above_left) {
  if constexpr (filter == kSub) return left;
  if constexpr (filter == kUp) return above;
  if constexpr (filter == kAverage) return static_cast<uint8_t>((left + above) / 2);
  if constexpr (filter == kPaeth) return Paeth(left, above, above_left);
  return 0;
}

// Undoes a filter of one byte per pixel. `out` may overlap `row` if it does not start behind it.
// Nearly all of a mask is like its surroundings: where eight filtered bytes are zero and all that
// they are predicted from is one value (or for kUp, in any case), so are the eight pixels.
template <Filter filter>
void Unfilter(const uint8_t* row, const uint8_t* above, size_t size, uint8_t* out) {
  constexpr uint64_t kEachByte = 0x0101010101010101;
  uint8_t left = 0;
  uint8_t above_left = 0;
  const auto step = [&](size_t i) {
    const uint8_t above_i = above[i];
    out[i] = left = static_cast<uint8_t>(row[i] + Predict<filter>(left, above_i, above_left));
    above_left = above_i;
  };
  size_t i = 0;
  for (; i + 8 <= size; i += 8) {
    uint64_t filtered = 0;
    uint64_t from = 0;
    std::memcpy(&filtered, row + i, 8);
    std::memcpy(&from, above + i, 8);
    const uint64_t same = left * kEachByte;
    if (filtered == 0 && (filter == kSub || filter == kUp || from == same)) {
      std::memcpy(out + i, filter == kUp ? &from : &same, 8);
      above_left = above[i + 7];  // `left` remains, and kUp does not ask for it
    } else {
      for (size_t j = i; j < i + 8; ++j) step(j);
    }
  }
  for (; i < size; ++i) step(i);
}

// From rows behind their filter bytes to rows without these, in place. False for unknown filters.
bool UnfilterRows(std::vector<uint8_t>& bytes, size_t row_size, size_t num_rows) {
  const std::vector<uint8_t> zeros(row_size, 0);
  const uint8_t* above = zeros.data();
  for (size_t y = 0; y < num_rows; ++y) {
    const uint8_t* row = &bytes[y * (row_size + 1)];
    uint8_t* out = &bytes[y * row_size];
    switch (*row++) {
      case kNone:
        std::memmove(out, row, row_size);
        break;
      case kSub:
        Unfilter<kSub>(row, above, row_size, out);
        break;
      case kUp:
        Unfilter<kUp>(row, above, row_size, out);
        break;
      case kAverage:
        Unfilter<kAverage>(row, above, row_size, out);
        break;
      case kPaeth:
        Unfilter<kPaeth>(row, above, row_size, out);
        break;
      default:
        return false;
    }
    above = out;
  }
  return true;
}

GrayImage FromBits(const std::vector<uint8_t>& bytes, size_t row_size, const ImageSize& size) {
  GrayImage image(static_cast<int>(size.width), static_cast<int>(size.height));
  for (int y = 0; y < image.height(); ++y) {
    const uint8_t* row = &bytes[static_cast<size_t>(y) * row_size];
    for (int x = 0; x < image.width(); ++x) {
      if ((row[x / 8] >> (7 - x % 8) & 1) != 0) image(x, y) = 255;
    }
  }
  return image;
}

}  // namespace

std::optional<GrayImage> DecodeGrayPng(Bytes file) {
  constexpr uint64_t kMaxSide = 1'000'000;
  constexpr uint64_t kMaxPixels = uint64_t{1} << 30;
  constexpr size_t kMaxInflation = 1032;  // of a DEFLATE stream
  const auto format = ParsePngFormat(file);
  const auto size = ParseImageSize(file);
  if (!format || !size || format->colour != PngColour::kGray) return std::nullopt;
  if (format->bit_depth != 8 && format->bit_depth != 1) return std::nullopt;
  if (size->width > kMaxSide || size->height > kMaxSide) return std::nullopt;
  if (size->width * size->height > kMaxPixels) return std::nullopt;
  const size_t row_size = format->bit_depth == 8 ? size->width : (size->width + 7) / 8;
  const size_t num_filtered = size->height * (row_size + 1);
  const auto zlib = JoinImageData(file);
  if (!zlib || num_filtered / kMaxInflation > zlib->size()) return std::nullopt;
  std::vector<uint8_t> bytes(num_filtered);
  if (!Inflate(*zlib, bytes) || !UnfilterRows(bytes, row_size, size->height)) return std::nullopt;
  if (format->bit_depth == 1) return FromBits(bytes, row_size, *size);
  bytes.resize(size->width * size->height);
  return GrayImage(static_cast<int>(size->width), static_cast<int>(size->height), std::move(bytes));
}

}  // namespace vgtw
