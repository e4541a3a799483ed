// SPDX-License-Identifier: BSD-3-Clause
#include "scene/image_io.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/scene/exif_jpeg.h"
#include "tests/scene/raw_png.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

RgbImage MakeRamp(int width, int height) {
  RgbImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image(x, y) = {static_cast<uint8_t>(x), static_cast<uint8_t>(y), static_cast<uint8_t>(x * y)};
    }
  }
  return image;
}

// What() of the Error that `call` throws; one line, as every Error.
template <typename Call>
std::string ErrorOf(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
    return what;
  }
  return "no error";
}

TEST(WriteImage, RoundTripsPng) {
  const TemporaryFolder folder;
  const RgbImage image = MakeRamp(50, 30);
  WriteImage(folder / "new/folder/a.PNG", image);
  EXPECT_EQ(ReadRgbImage(folder / "new/folder/a.PNG"), image);
  EXPECT_EQ(ReadImageSize(folder / "new/folder/a.PNG"), (ImageSize{50, 30}));
}

TEST(WriteImage, GrayReadsAsEqualChannels) {
  const TemporaryFolder folder;
  GrayImage image(3, 1);
  image.data() = {0, 77, 255};
  WriteImage(folder / "a.png", image);
  EXPECT_EQ(ReadRgbImage(folder / "a.png").data(),
            (std::vector<Rgb>{{0, 0, 0}, {77, 77, 77}, {255, 255, 255}}));
}

TEST(WriteImage, RefusesOtherExtensionsAndEmptyImages) {
  const TemporaryFolder folder;
  EXPECT_NE(ErrorOf([&] { WriteImage(folder / "a.gif", MakeRamp(2, 2)); }).find(".gif"),
            std::string::npos);
  EXPECT_THROW(WriteImage(folder / "a.png", RgbImage()), Error);
  EXPECT_TRUE(Snapshot(folder.path()).empty());
}

// Orientation 6 asks viewers to turn the photo by 90 degrees; COLMAP does not.
TEST(ReadRgbImage, IgnoresExifOrientation) {
  const TemporaryFolder folder;
  RgbImage image(64, 32, {0, 0, 0});
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) image(x, y) = {255, 255, 255};
  }
  WriteImage(folder / "plain.jpg", image);
  WriteFileAtomically(folder / "turned.jpg",
                      InsertExif(ReadFile(folder / "plain.jpg"), MakeExif({.orientation = 6})));
  EXPECT_EQ(ReadImageSize(folder / "turned.jpg"), (ImageSize{64, 32}));
  EXPECT_EQ(ReadRgbImage(folder / "turned.jpg"), ReadRgbImage(folder / "plain.jpg"));
  EXPECT_GT(ReadRgbImage(folder / "turned.jpg")(5, 25)[0], 250);
}

TEST(ReadRgbImage, DropsAlphaAndReadsOtherKindsOfPng) {
  const TemporaryFolder folder;
  // Filter byte, then R G B A: alpha 0 does not hide the colour.
  WriteFileAtomically(folder / "rgba.png", MakePng(1, 1, 8, 6, std::string("\0\x0a\x14\x1e\0", 5)));
  EXPECT_EQ(ReadRgbImage(folder / "rgba.png").data(), (std::vector<Rgb>{{10, 20, 30}}));
  const std::string palette = PngChunk("PLTE", std::string("\0\0\0\x05\x06\x07", 6));
  WriteFileAtomically(folder / "palette.png",
                      MakePng(2, 1, 8, 3, std::string("\0\1\0", 3), palette));
  EXPECT_EQ(ReadRgbImage(folder / "palette.png").data(), (std::vector<Rgb>{{5, 6, 7}, {0, 0, 0}}));
  WriteFileAtomically(folder / "sixteen.png", MakePng(1, 1, 16, 0, std::string("\0\x80\x12", 3)));
  EXPECT_EQ(ReadRgbImage(folder / "sixteen.png").data(), (std::vector<Rgb>{{128, 128, 128}}));
}

// value * alpha + 255 * (255 - alpha), over 255 and rounded: 132.02, 177.70, 127.00 at alpha 128,
// 224.80, 205.00 at alpha 50.
TEST(ReadRgbImageOnWhite, CompositesRgba) {
  const TemporaryFolder folder;
  const std::string row("\0\x0a\x14\x1e\0\x0a\x14\x1e\xff\x0a\x65\0\x80\x65\0\0\x32", 17);
  WriteFileAtomically(folder / "rgba.png", MakePng(4, 1, 8, 6, row));
  EXPECT_EQ(ReadRgbImageOnWhite(folder / "rgba.png").data(),
            (std::vector<Rgb>{{255, 255, 255}, {10, 20, 30}, {132, 178, 127}, {225, 205, 205}}));
  // Of 16 bits the upper 8 count, also for gray.
  WriteFileAtomically(folder / "rgba16.png",
                      MakePng(1, 1, 16, 6, std::string("\0\x65\xff\0\xff\0\xff\x32\xff", 9)));
  EXPECT_EQ(ReadRgbImageOnWhite(folder / "rgba16.png").data(), (std::vector<Rgb>{{225, 205, 205}}));
  WriteFileAtomically(folder / "gray_alpha16.png",
                      MakePng(1, 1, 16, 4, std::string("\0\x65\x80\x32\x80", 5)));
  EXPECT_EQ(ReadRgbImageOnWhite(folder / "gray_alpha16.png").data(),
            (std::vector<Rgb>{{225, 225, 225}}));
}

// Where the Python library does not composite, alpha is dropped.
TEST(ReadRgbImageOnWhite, ReadsOtherFilesAsReadRgbImage) {
  const TemporaryFolder folder;
  const std::string palette = PngChunk("PLTE", std::string("\0\0\0\x05\x06\x07", 6)) +
                              PngChunk("tRNS", std::string("\0\x80", 2));
  WriteFileAtomically(folder / "palette.png",
                      MakePng(2, 1, 8, 3, std::string("\0\1\0", 3), palette));
  WriteFileAtomically(folder / "gray_alpha.png", MakePng(1, 1, 8, 4, std::string("\0\x65\0", 3)));
  WriteImage(folder / "photo.jpg", MakeRamp(40, 30));
  for (const std::string name : {"palette.png", "gray_alpha.png", "photo.jpg"}) {
    EXPECT_EQ(ReadRgbImageOnWhite(folder / name), ReadRgbImage(folder / name)) << name;
  }
  EXPECT_EQ(ReadRgbImageOnWhite(folder / "gray_alpha.png").data(),
            (std::vector<Rgb>{{101, 101, 101}}));
}

TEST(ReadRgbImage, RefusesTruncatedFiles) {
  const TemporaryFolder folder;
  for (const std::string name : {"a.jpg", "a.png"}) {
    WriteImage(folder / name, MakeRamp(100, 100));
    const std::string bytes = ReadFile(folder / name);
    WriteFileAtomically(folder / name, std::string_view(bytes).substr(0, bytes.size() / 2));
    EXPECT_NE(ErrorOf([&] { ReadRgbImage(folder / name); }).find("truncated"), std::string::npos);
  }
}

TEST(ReadRgbImage, RefusesWhatIsNoImage) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "text.jpg", "hello");
  WriteFileAtomically(folder / "empty.jpg", "");
  EXPECT_NE(ErrorOf([&] { ReadRgbImage(folder / "text.jpg"); }).find("cannot be decoded"),
            std::string::npos);
  EXPECT_NE(ErrorOf([&] { ReadImageSize(folder / "empty.jpg"); }).find("is empty"),
            std::string::npos);
  EXPECT_NE(ErrorOf([&] { ReadRgbImage(folder / "none.jpg"); }).find("No such file"),
            std::string::npos);
}

TEST(ReadRgbImage, RefusesMorePixelsThanItsLimit) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "bomb.png", MakePng(1 << 16, 1 << 15, 8, 2, std::string(4, '\0')));
  EXPECT_THROW(ReadRgbImage(folder / "bomb.png"), Error);
}

TEST(ReadImageSize, DecodesFormatsWithoutAKnownHeader) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "a.ppm", "P6 2 1 255\nabcdef");
  EXPECT_EQ(ReadImageSize(folder / "a.ppm"), (ImageSize{2, 1}));
  EXPECT_EQ(ReadRgbImage(folder / "a.ppm").data(),
            (std::vector<Rgb>{{'a', 'b', 'c'}, {'d', 'e', 'f'}}));
}

// 0.2126 R + 0.7152 G + 0.0722 B, rounded: white 255, red 100 21.3, blue 7 0.505, blue 6 0.433.
TEST(ReadMaskValues, AreLuma) {
  const TemporaryFolder folder;
  WriteFileAtomically(
      folder / "rgb.png",
      MakePng(4, 1, 8, 2, std::string("\0\xff\xff\xff\x64\0\0\0\0\x07\0\0\x06", 13)));
  EXPECT_EQ(ReadMaskValues(folder / "rgb.png").data(), (std::vector<uint8_t>{255, 21, 1, 0}));
  WriteFileAtomically(folder / "one_bit.png", MakePng(4, 1, 1, 0, std::string("\0\x50", 2)));
  EXPECT_EQ(ReadMaskValues(folder / "one_bit.png").data(), (std::vector<uint8_t>{0, 255, 0, 255}));
}

TEST(ReadGrayImage, IsLumaToTheBit) {
  const TemporaryFolder folder;
  RgbImage image(4, 1);
  // The last two are 15.5 and 115.5 but for rounding; measured with COLMAP's library.
  image.data() = {{255, 255, 255}, {100, 0, 0}, {0, 14, 76}, {0, 150, 100}};
  WriteImage(folder / "rgb.png", image);
  EXPECT_EQ(ReadGrayImage(folder / "rgb.png").data(), (std::vector<uint8_t>{255, 21, 16, 115}));
  GrayImage gray(3, 1);
  gray.data() = {0, 77, 255};
  WriteImage(folder / "gray.png", gray);
  EXPECT_EQ(ReadGrayImage(folder / "gray.png"), gray);
  WriteFileAtomically(folder / "sixteen.png", MakePng(1, 1, 16, 0, std::string("\0\x80\xff", 3)));
  EXPECT_EQ(ReadGrayImage(folder / "sixteen.png").data(), (std::vector<uint8_t>{128}));
  WriteFileAtomically(folder / "rgba.png", MakePng(1, 1, 8, 6, std::string("\0\x64\0\0\0", 5)));
  EXPECT_EQ(ReadGrayImage(folder / "rgba.png").data(), (std::vector<uint8_t>{21}));
}

TEST(ReadAlpha, IsTheFourthChannelOrNone) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "rgba.png",
                      MakePng(2, 1, 8, 6, std::string("\0\1\2\3\x80\1\2\3\0", 9)));
  EXPECT_EQ(ReadAlpha(folder / "rgba.png")->data(), (std::vector<uint8_t>{128, 0}));
  WriteFileAtomically(folder / "gray_alpha.png", MakePng(1, 1, 8, 4, std::string("\0\1\x05", 3)));
  EXPECT_EQ(ReadAlpha(folder / "gray_alpha.png")->data(), (std::vector<uint8_t>{5}));
  const std::string palette = PngChunk("PLTE", std::string("\0\0\0\x05\x06\x07", 6)) +
                              PngChunk("tRNS", std::string("\0\x80", 2));
  WriteFileAtomically(folder / "palette.png",
                      MakePng(2, 1, 8, 3, std::string("\0\1\0", 3), palette));
  EXPECT_EQ(ReadAlpha(folder / "palette.png")->data(), (std::vector<uint8_t>{128, 0}));
  WriteImage(folder / "opaque.png", GrayImage(2, 1, 9));
  EXPECT_EQ(ReadAlpha(folder / "opaque.png"), std::nullopt);
  WriteFileAtomically(folder / "deep.png", MakePng(1, 1, 16, 6, std::string(9, '\0')));
  EXPECT_EQ(ReadAlpha(folder / "deep.png"), std::nullopt);
}

TEST(ReadStaticMask, KeepsEveryNonZeroGray) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "gray.png", MakePng(4, 1, 8, 0, std::string("\0\0\x01\x80\xff", 5)));
  EXPECT_EQ(ReadStaticMask(folder / "gray.png").data(), (std::vector<uint8_t>{0, 255, 255, 255}));
  // The gray that counts as transparent is gray to COLMAP, too.
  WriteFileAtomically(
      folder / "transparent.png",
      MakePng(2, 1, 8, 0, std::string("\0\x80\0", 3), PngChunk("tRNS", std::string("\0\x80", 2))));
  EXPECT_EQ(ReadStaticMask(folder / "transparent.png").data(), (std::vector<uint8_t>{255, 0}));
}

TEST(ReadStaticMask, ReadsBitsPalettesAndAlpha) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "bits.png", MakePng(3, 1, 1, 0, std::string("\0\xa0", 2)));
  EXPECT_EQ(ReadStaticMask(folder / "bits.png").data(), (std::vector<uint8_t>{255, 0, 255}));
  const std::string palette = PngChunk("PLTE", std::string("\xff\0\0\0\0\0", 6));
  WriteFileAtomically(folder / "palette.png",
                      MakePng(2, 1, 8, 3, std::string("\0\1\0", 3), palette));
  EXPECT_EQ(ReadStaticMask(folder / "palette.png").data(), (std::vector<uint8_t>{0, 255}));
  // Black with full alpha is excluded, red without alpha is kept.
  WriteFileAtomically(folder / "rgba.png",
                      MakePng(2, 1, 8, 6, std::string("\0\0\0\0\xff\xff\0\0\0", 9)));
  EXPECT_EQ(ReadStaticMask(folder / "rgba.png").data(), (std::vector<uint8_t>{0, 255}));
}

TEST(ReadStaticMask, Refuses16BitsAndTruncation) {
  const TemporaryFolder folder;
  const std::string sixteen = MakePng(1, 1, 16, 0, std::string("\0\xff\xff", 3));
  WriteFileAtomically(folder / "sixteen.png", sixteen);
  EXPECT_NE(ErrorOf([&] { ReadStaticMask(folder / "sixteen.png"); }).find("8-bit"),
            std::string::npos);
  WriteFileAtomically(folder / "cut.png", std::string_view(sixteen).substr(0, sixteen.size() - 5));
  EXPECT_NE(ErrorOf([&] { ReadStaticMask(folder / "cut.png"); }).find("truncated"),
            std::string::npos);
}

TEST(ReadExifFocalLength, ComesFromTheFile) {
  const TemporaryFolder folder;
  WriteImage(folder / "plain.jpg", MakeRamp(70, 40));
  WriteFileAtomically(
      folder / "exif.jpg",
      InsertExif(ReadFile(folder / "plain.jpg"), MakeExif({.focal_length_35mm = 28})));
  // 28 / 35 of the longer side.
  EXPECT_DOUBLE_EQ(ReadExifFocalLength(folder / "exif.jpg", {70, 40}).value(), 56.0);
  EXPECT_EQ(ReadExifFocalLength(folder / "plain.jpg", {70, 40}), std::nullopt);
  EXPECT_THROW(ReadExifFocalLength(folder / "none.jpg", {70, 40}), Error);
}

TEST(ListImages, IsSortedByBytesAndSkipsOtherFiles) {
  const TemporaryFolder folder;
  for (const std::string name : {"b.jpg",
                                 "B.JPEG",
                                 "a/z.png",
                                 "a.tiff",
                                 "a/y.txt",
                                 "a-b.bmp",
                                 ".hidden.png",
                                 ".git/x.png",
                                 "noextension"}) {
    std::filesystem::create_directories((folder / name).parent_path());
    WriteFileAtomically(folder / name, "x");
  }
  EXPECT_EQ(ListImages(folder.path()),
            (std::vector<std::string>{"B.JPEG", "a-b.bmp", "a.tiff", "a/z.png", "b.jpg"}));
}

TEST(ListImages, RefusesMissingAndEmptyFolders) {
  const TemporaryFolder folder;
  EXPECT_NE(ErrorOf([&] { ListImages(folder / "none"); }).find("is not a folder"),
            std::string::npos);
  EXPECT_NE(ErrorOf([&] { ListImages(folder.path()); }).find("holds no image"), std::string::npos);
}

TEST(ListImages, RefusesNamesThatColmapsFilesCannotHold) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "new\nline.jpg", "x");
  EXPECT_NE(ErrorOf([&] { ListImages(folder.path()); }).find("rename"), std::string::npos);
}

}  // namespace
}  // namespace vgtw
