// SPDX-License-Identifier: BSD-3-Clause
#include "scene/image_io.h"

#include "scene/error.h"
#include "scene/exif_focal_length.h"
#include "scene/files.h"
#include "scene/gray_png.h"
#include "scene/image_header.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <set>
#include <string_view>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

// The stored pixels; `flags` as in cv::imread.
cv::Mat Decode(const fs::path& path,
               std::span<const std::byte> bytes,
               int flags = cv::IMREAD_COLOR) {
  constexpr std::string_view kExpected =
      "a JPEG, PNG, TIFF, BMP or PPM image of at most 2^30 pixels";
  if (bytes.empty()) Fail(path, "is empty", kExpected);
  if (IsTruncated(bytes)) {
    Fail(path, "is truncated (its end marker is missing)", "a complete file", "copy it again");
  }
  if (bytes.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    Fail(path, "has more than 2 GiB", kExpected);
  }
  const cv::Mat buffer(1,
                       static_cast<int>(bytes.size()),
                       CV_8UC1,
                       const_cast<std::byte*>(bytes.data()));  // only read by imdecode
  cv::Mat pixels;
  try {
    pixels = cv::imdecode(buffer, flags | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    pixels.release();
  }
  if (pixels.empty()) Fail(path, "cannot be decoded", kExpected);
  return pixels;
}

// As COLMAP's library makes gray of colours: luma of Rec. 709, in float, rounded.
GrayImage ToLuma(const cv::Mat& bgr) {
  GrayImage luma(bgr.cols, bgr.rows);
  std::transform(
      bgr.begin<cv::Vec3b>(),
      bgr.end<cv::Vec3b>(),
      luma.data().begin(),
      [](const cv::Vec3b& pixel) {
        const auto blue = static_cast<float>(pixel[0]);
        const auto green = static_cast<float>(pixel[1]);
        const auto red = static_cast<float>(pixel[2]);
        return static_cast<uint8_t>(0.2126f * red + 0.7152f * green + 0.0722f * blue + 0.5f);
      });
  return luma;
}

std::string LowerExtension(const fs::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return extension;
}

cv::Mat BgrOf(const RgbImage& image) {
  const cv::Mat rgb(image.height(), image.width(), CV_8UC3, const_cast<Rgb*>(image.data().data()));
  cv::Mat bgr;
  if (!image.empty()) cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  return bgr;
}

void Encode(const fs::path& path, const cv::Mat& pixels) {
  const std::string extension = LowerExtension(path);
  if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") {
    Fail(path,
         "has the extension '" + Printable(extension) + "'",
         "an image to write as .png, .jpg or .jpeg");
  }
  std::vector<uchar> bytes;
  if (pixels.empty() || !cv::imencode(extension, pixels, bytes)) {
    Fail(path, "cannot be encoded", "an image of 1 to 65535 pixels a side");
  }
  std::error_code code;
  if (path.has_parent_path()) fs::create_directories(path.parent_path(), code);
  if (code) throw Error(Printable(path.string()) + ": cannot be written: " + code.message());
  AtomicFile file(path);
  file.Write(std::as_bytes(std::span(bytes)));
  file.Commit();
}

bool IsHidden(const fs::path& path) { return path.filename().string().starts_with("."); }

bool IsImageName(const fs::path& path) {
  static const std::set<std::string, std::less<>> kExtensions = {
      ".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".ppm", ".pgm"};
  return kExtensions.contains(LowerExtension(path));
}

}  // namespace

RgbImage ReadRgbImage(const fs::path& path) {
  const MappedFile file(path);
  const cv::Mat bgr = Decode(path, file.bytes());
  RgbImage image(bgr.cols, bgr.rows);
  cv::Mat rgb(bgr.rows, bgr.cols, CV_8UC3, image.data().data());
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  return image;
}

RgbImage ReadRgbImageOnWhite(const fs::path& path) {
  const MappedFile file(path);
  if (!HasAlphaForPython(file.bytes())) return ReadRgbImage(path);
  cv::Mat bgra = Decode(path, file.bytes(), cv::IMREAD_UNCHANGED);
  if (bgra.depth() == CV_16U) {
    constexpr double kScale = 1.0 / 256;
    bgra.convertTo(bgra, CV_8U, kScale, -127.5 * kScale);  // the upper byte; no tie to round
  }
  RgbImage image(bgra.cols, bgra.rows);
  std::transform(bgra.begin<cv::Vec4b>(),
                 bgra.end<cv::Vec4b>(),
                 image.data().begin(),
                 [](const cv::Vec4b& pixel) -> Rgb {
                   const auto on_white = [&](int channel) {
                     const int sum = pixel[channel] * pixel[3] + 255 * (255 - pixel[3]);
                     return static_cast<uint8_t>((sum + 127) / 255);
                   };
                   return {on_white(2), on_white(1), on_white(0)};
                 });
  return image;
}

GrayImage ReadGrayImage(const fs::path& path) {
  const MappedFile file(path);
  const cv::Mat pixels = Decode(path, file.bytes(), cv::IMREAD_ANYCOLOR);
  if (pixels.channels() != 1) return ToLuma(pixels);
  GrayImage image(pixels.cols, pixels.rows);
  std::copy(pixels.begin<uint8_t>(), pixels.end<uint8_t>(), image.data().begin());
  return image;
}

ImageSize ReadImageSize(const fs::path& path) {
  const MappedFile file(path);
  if (const auto size = ParseImageSize(file.bytes())) return *size;
  const cv::Mat pixels = Decode(path, file.bytes());
  return {static_cast<uint64_t>(pixels.cols), static_cast<uint64_t>(pixels.rows)};
}

GrayImage ReadMaskValues(const fs::path& path) {
  const MappedFile file(path);
  if (auto values = DecodeGrayPng(file.bytes())) return *std::move(values);
  const cv::Mat bgr = Decode(path, file.bytes(), cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH);
  if (bgr.depth() != CV_8U) {
    Fail(path, "has more than 8 bits per channel", "an 8-bit mask", "COLMAP 3.8 drops its image");
  }
  return ToLuma(bgr);
}

StaticMask ReadStaticMask(const fs::path& path) {
  StaticMask static_mask = ReadMaskValues(path);
  std::vector<uint8_t>& values = static_mask.data();
  const auto make_binary = [&](size_t i) { values[i] = values[i] == 0 ? 0 : 255; };
  size_t i = 0;
  for (; i + 8 <= values.size(); i += 8) {
    uint64_t word = 0;
    std::memcpy(&word, &values[i], 8);
    if (word == 0 || word == ~uint64_t{0}) continue;  // most of a mask
    for (size_t j = i; j < i + 8; ++j) make_binary(j);
  }
  for (; i < values.size(); ++i) make_binary(i);
  return static_mask;
}

std::optional<GrayImage> ReadAlpha(const fs::path& path) {
  const MappedFile file(path);
  const cv::Mat bgra = Decode(path, file.bytes(), cv::IMREAD_UNCHANGED);
  if (bgra.type() != CV_8UC4) return std::nullopt;
  GrayImage alpha(bgra.cols, bgra.rows);
  std::transform(bgra.begin<cv::Vec4b>(),
                 bgra.end<cv::Vec4b>(),
                 alpha.data().begin(),
                 [](const cv::Vec4b& pixel) { return pixel[3]; });
  return alpha;
}

void WriteImage(const fs::path& path, const RgbImage& image) { Encode(path, BgrOf(image)); }

std::vector<std::byte> EncodeJpeg(const RgbImage& image, int quality) {
  VGTW_CHECK(!image.empty() && quality >= 1 && quality <= 100, "EncodeJpeg");
  std::vector<uchar> bytes;
  VGTW_CHECK(cv::imencode(".jpg", BgrOf(image), bytes, {cv::IMWRITE_JPEG_QUALITY, quality}),
             "an image of at most 65500 pixels a side");
  const auto view = std::as_bytes(std::span(bytes));
  return {view.begin(), view.end()};
}

void WriteImage(const fs::path& path, const GrayImage& image) {
  Encode(
      path,
      cv::Mat(image.height(), image.width(), CV_8UC1, const_cast<uint8_t*>(image.data().data())));
}

std::optional<double> ReadExifFocalLength(const fs::path& path, const ImageSize& size) {
  const MappedFile file(path);
  return ParseExifFocalLength(FindExif(file.bytes()), size);
}

std::vector<std::string> ListImages(const fs::path& folder) {
  if (!fs::is_directory(folder)) Fail(folder, "is not a folder", "a folder of images");
  std::vector<std::string> names;
  for (auto it = fs::recursive_directory_iterator(folder); it != fs::recursive_directory_iterator();
       ++it) {
    if (IsHidden(it->path())) {
      it.disable_recursion_pending();
      continue;
    }
    if (!it->is_regular_file() || !IsImageName(it->path())) continue;
    std::string name = it->path().lexically_relative(folder).generic_string();
    if (!IsSafeRelativeName(name)) {
      Fail(
          folder / name, "has a name with control characters or '\\'", "a plain name", "rename it");
    }
    names.push_back(std::move(name));
  }
  if (names.empty()) {
    Fail(folder, "holds no image", "jpg, jpeg, png, tif, tiff, bmp, ppm or pgm files");
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace vgtw
