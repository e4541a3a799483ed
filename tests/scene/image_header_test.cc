// SPDX-License-Identifier: BSD-3-Clause
#include "scene/image_header.h"

#include "scene/files.h"
#include "tests/scene/exif_jpeg.h"
#include "tests/scene/raw_png.h"
#include "tests/support/temporary_folder.h"

#include <string>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

std::span<const std::byte> Bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

std::string EncodedImage(const std::string& name) {
  const TemporaryFolder folder;
  RgbImage image(37, 21);
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 37; ++x) image(x, y) = {uint8_t(7 * x), uint8_t(11 * y), uint8_t(x * y)};
  }
  WriteImage(folder / name, image);
  return ReadFile(folder / name);
}

// SOI, a frame header (SOF2) of 300 x 200 and three components, EOI.
const std::string kHandmadeJpeg(
    "\xff\xd8\xff\xc2\x00\x11\x08\x00\xc8\x01\x2c\x03"
    "\x01\x22\x00\x02\x11\x01\x03\x11\x01\xff\xd9",
    23);

TEST(ParseImageSize, ReadsHandmadeHeaders) {
  EXPECT_EQ(ParseImageSize(Bytes(kHandmadeJpeg)), (ImageSize{300, 200}));
  EXPECT_EQ(ParseImageSize(Bytes(MakePng(70000, 2, 8, 0, ""))), (ImageSize{70000, 2}));
}

TEST(ParseImageSize, ReadsEncodersFiles) {
  EXPECT_EQ(ParseImageSize(Bytes(EncodedImage("a.jpg"))), (ImageSize{37, 21}));
  EXPECT_EQ(ParseImageSize(Bytes(EncodedImage("a.png"))), (ImageSize{37, 21}));
}

// DHT (c4) has a number in the range of frame headers.
TEST(ParseImageSize, SkipsTablesAndFillBytes) {
  const std::string table("\xff\xff\xff\xc4\x00\x0a\x08\x00\x01\x00\x01\x03\x00\x00", 14);
  const std::string jpeg = kHandmadeJpeg.substr(0, 2) + table + kHandmadeJpeg.substr(2);
  EXPECT_EQ(ParseImageSize(Bytes(jpeg)), (ImageSize{300, 200}));
}

TEST(ParseImageSize, IsUnknownForOtherAndEmptyImages) {
  EXPECT_EQ(ParseImageSize({}), std::nullopt);
  EXPECT_EQ(ParseImageSize(Bytes("P5 2 2 255 abcd")), std::nullopt);
  EXPECT_EQ(ParseImageSize(Bytes(MakePng(0, 5, 8, 0, ""))), std::nullopt);
  EXPECT_EQ(ParseImageSize(Bytes("\xff\xd8\xff\xd9")), std::nullopt);
}

TEST(ParsePngFormat, SaysDepthAndColour) {
  for (const int colour : {0, 2, 3, 4, 6}) {
    const auto format = ParsePngFormat(Bytes(MakePng(1, 1, 16, colour, "")));
    ASSERT_TRUE(format);
    EXPECT_EQ(format->bit_depth, 16);
    EXPECT_EQ(static_cast<int>(format->colour), colour);
  }
  EXPECT_EQ(ParsePngFormat(Bytes(MakePng(1, 1, 1, 0, "")))->bit_depth, 1);
  EXPECT_FALSE(ParsePngFormat(Bytes(MakePng(1, 1, 7, 0, ""))));
  EXPECT_FALSE(ParsePngFormat(Bytes(MakePng(1, 1, 8, 5, ""))));
  EXPECT_FALSE(ParsePngFormat(Bytes(EncodedImage("a.jpg"))));
  EXPECT_FALSE(ParsePngFormat({}));
}

TEST(HasAlphaForPython, DependsOnTheColourType) {
  const auto has_alpha = [](int bit_depth, int colour_type) {
    return HasAlphaForPython(Bytes(MakePng(1, 1, bit_depth, colour_type, "")));
  };
  EXPECT_TRUE(has_alpha(8, 6));
  EXPECT_TRUE(has_alpha(16, 6));
  EXPECT_TRUE(has_alpha(16, 4));
  EXPECT_FALSE(has_alpha(8, 4));
  EXPECT_FALSE(has_alpha(8, 2));
  EXPECT_FALSE(HasAlphaForPython({}));
}

TEST(IsTruncated, HoldsForEveryProperPrefix) {
  for (const std::string name : {"a.jpg", "a.png"}) {
    const std::string file = EncodedImage(name);
    EXPECT_FALSE(IsTruncated(Bytes(file))) << name;
    for (size_t size = 8; size < file.size(); ++size) {
      ASSERT_TRUE(IsTruncated(Bytes(file.substr(0, size)))) << name << " " << size;
    }
  }
}

TEST(IsTruncated, AllowsBytesBehindTheEnd) {
  EXPECT_FALSE(IsTruncated(Bytes(EncodedImage("a.jpg") + "appended video")));
  EXPECT_FALSE(IsTruncated(Bytes(EncodedImage("a.png") + "appended video")));
}

TEST(IsTruncated, IsNotFooledByTheThumbnailsEnd) {
  const std::string jpeg = EncodedImage("a.jpg");
  const std::string with_thumbnail = InsertExif(jpeg, MakeExif({}) + jpeg);
  EXPECT_FALSE(IsTruncated(Bytes(with_thumbnail)));
  EXPECT_TRUE(IsTruncated(Bytes(with_thumbnail.substr(0, with_thumbnail.size() - 2))));
}

TEST(FindExif, GivesThePayload) {
  const std::string exif = MakeExif({.focal_length_35mm = 28});
  const std::string file = InsertExif(EncodedImage("a.jpg"), exif);
  const std::span<const std::byte> found = FindExif(Bytes(file));
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(found.data()), found.size()), exif);
}

TEST(FindExif, IsEmptyWhereThereIsNone) {
  EXPECT_TRUE(FindExif({}).empty());
  EXPECT_TRUE(FindExif(Bytes(EncodedImage("a.jpg"))).empty());
  EXPECT_TRUE(FindExif(Bytes(EncodedImage("a.png"))).empty());
}

// Sizes that claim more than there is; a sanitizer would see a read outside.
TEST(ImageHeader, SurvivesEveryChangedByte) {
  for (const std::string& file :
       {InsertExif(EncodedImage("a.jpg"), MakeExif({})), EncodedImage("a.png")}) {
    for (size_t i = 0; i < std::min<size_t>(file.size(), 400); ++i) {
      for (const int value : {0, 1, 0x7f, 0xd9, 0xff}) {
        std::string changed = file;
        changed[i] = static_cast<char>(value);
        const auto size = ParseImageSize(Bytes(changed));
        if (size) {
          EXPECT_GT(size->width * size->height, 0u);
        }
        EXPECT_LE(FindExif(Bytes(changed)).size(), file.size());
        IsTruncated(Bytes(changed));
      }
    }
  }
}

}  // namespace
}  // namespace vgtw
