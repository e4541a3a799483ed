// SPDX-License-Identifier: BSD-3-Clause
#include "scene/gray_png.h"

#include "scene/files.h"
#include "tests/scene/raw_png.h"
#include "tests/support/temporary_folder.h"

#include <random>
#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::optional<GrayImage> Decode(const std::string& file) {
  return DecodeGrayPng(std::as_bytes(std::span(file)));
}

// Discs and single pixels: runs longer and shorter than a machine word in both directions.
GrayImage Discs(int width, int height) {
  GrayImage image(width, height, 255);
  std::mt19937 random(1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int dx = x % 40 - 20;
      const int dy = y % 40 - 20;
      if (dx * dx + dy * dy < 225) image(x, y) = 0;
      if (random() % 97 == 0) image(x, y) = static_cast<uint8_t>(random());
    }
  }
  return image;
}

// By the formulas of the specification (PNG 9.2), without any shortcut.
std::string FilteredRow(const GrayImage& image, int y, int filter) {
  const auto at = [&](int px, int py) { return image.Contains(px, py) ? image(px, py) : 0; };
  std::string row(1, static_cast<char>(filter));
  for (int x = 0; x < image.width(); ++x) {
    const int a = at(x - 1, y);
    const int b = at(x, y - 1);
    const int c = at(x - 1, y - 1);
    const int p = a + b - c;
    const int pa = std::abs(p - a);
    const int pb = std::abs(p - b);
    const int pc = std::abs(p - c);
    const int paeth = pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
    const int predicted[] = {0, a, b, (a + b) / 2, paeth};
    row += static_cast<char>(image(x, y) - predicted[filter]);
  }
  return row;
}

TEST(DecodeGrayPng, UndoesEveryFilter) {
  for (const int width : {1, 7, 8, 9, 123}) {
    const GrayImage image = Discs(width, 97);
    for (int first = 0; first <= 5; ++first) {  // 5: each row another one
      std::string rows;
      for (int y = 0; y < 97; ++y) rows += FilteredRow(image, y, first < 5 ? first : (y * 7) % 5);
      const auto decoded = Decode(MakePng(static_cast<uint32_t>(width), 97, 8, 0, rows));
      ASSERT_TRUE(decoded) << width << " " << first;
      EXPECT_EQ(*decoded, image) << width << " " << first;
    }
  }
}

TEST(DecodeGrayPng, ReadsWhatTheEncoderWrites) {
  const TemporaryFolder folder;
  const GrayImage image = Discs(611, 403);
  WriteImage(folder / "a.png", image);
  EXPECT_EQ(Decode(ReadFile(folder / "a.png")), image);
}

// Eleven pixels a row: the last byte holds three of them and five bits that do not count. The
// second row is filtered by kUp: 0xa0 + 0xff = 0x9f, 0x5f + 0x80 = 0xdf.
TEST(DecodeGrayPng, ReadsBits) {
  const std::string rows("\0\xa0\x5f\2\xff\x80", 6);
  const auto decoded = Decode(MakePng(11, 2, 1, 0, rows));
  ASSERT_TRUE(decoded);
  const std::vector<uint8_t> first = {255, 0, 255, 0, 0, 0, 0, 0, 0, 255, 0};
  const std::vector<uint8_t> second = {255, 0, 0, 255, 255, 255, 255, 255, 255, 255, 0};
  std::vector<uint8_t> expected = first;
  expected.insert(expected.end(), second.begin(), second.end());
  EXPECT_EQ(decoded->data(), expected);
}

TEST(DecodeGrayPng, LeavesOtherKindsToOthers) {
  EXPECT_FALSE(Decode(""));
  EXPECT_FALSE(Decode("\xff\xd8\xff\xd9"));
  EXPECT_FALSE(Decode(MakePng(1, 1, 8, 2, std::string(4, '\0'))));   // RGB
  EXPECT_FALSE(Decode(MakePng(1, 1, 16, 0, std::string(3, '\0'))));  // 16 bits
  EXPECT_FALSE(Decode(MakePng(1, 1, 2, 0, std::string(2, '\0'))));   // 2 bits
  const std::string row(2, '\0');
  EXPECT_TRUE(Decode(MakePng(1, 1, 8, 0, row, PngChunk("tEXt", "a"))));
  EXPECT_FALSE(Decode(MakePng(1, 1, 8, 0, row, PngChunk("tRNS", std::string(2, '\0')))));
  EXPECT_FALSE(Decode(MakePng(1, 1, 8, 0, row, PngChunk("NEWX", ""))));  // critical and unknown
}

TEST(DecodeGrayPng, LeavesFaultsToOthers) {
  const std::string good = MakePng(9, 5, 8, 0, std::string(50, '\0'));
  ASSERT_TRUE(Decode(good));
  for (size_t size = 0; size < good.size(); ++size) EXPECT_FALSE(Decode(good.substr(0, size)));
  for (size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 1);
    EXPECT_FALSE(Decode(bad)) << "byte " << i;
  }
  EXPECT_FALSE(Decode(MakePng(9, 5, 8, 0, std::string(50, '\5'))));   // no such filter
  EXPECT_FALSE(Decode(MakePng(9, 5, 8, 0, std::string(49, '\0'))));   // a byte less
  EXPECT_FALSE(Decode(MakePng(9, 5, 8, 0, std::string(51, '\0'))));   // a byte more
  EXPECT_FALSE(Decode(MakePng(900000, 900, 8, 0, "")));               // nothing behind the sizes
  EXPECT_FALSE(Decode(MakePng(4000000000u, 4000000000u, 8, 0, "")));  // whose product overflows
}

// Image data in pieces, as encoders write it; they must follow each other.
TEST(DecodeGrayPng, JoinsImageData) {
  const std::string whole = MakePng(2, 1, 8, 0, std::string("\0\1\2", 3));
  const size_t begin = whole.find("IDAT") + 4;
  const std::string zlib = whole.substr(begin, whole.find("IEND") - 8 - begin);
  const std::string head = whole.substr(0, begin - 8);
  const std::string a = PngChunk("IDAT", zlib.substr(0, 5));
  const std::string b = PngChunk("IDAT", zlib.substr(5));
  const std::string end = PngChunk("IEND", "");
  const auto decoded = Decode(head + a + PngChunk("IDAT", "") + b + end + "trailing bytes");
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->data(), (std::vector<uint8_t>{1, 2}));
  EXPECT_FALSE(Decode(head + a + PngChunk("tIME", "1234567") + b + end));
}

}  // namespace
}  // namespace vgtw
