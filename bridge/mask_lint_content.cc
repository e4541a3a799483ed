// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint_content.h"

#include "bridge/mask_lint_rules.h"
#include "bridge/mask_resample.h"
#include "scene/error.h"
#include "scene/exif_orientation.h"
#include "scene/files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string_view>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

constexpr int kHalf = 128;

bool IsConstant(const GrayImage& image) {
  const auto& values = image.data();
  return std::adjacent_find(values.begin(), values.end(), std::not_equal_to<>()) == values.end();
}

bool SaysTheSame(const GrayImage& a, const GrayImage& b) {
  return std::equal(a.data().begin(), a.data().end(), b.data().begin(), [](int left, int right) {
    return (left == 0) == (right == 0);
  });
}

std::string Percent(double share) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.2f %%", 100.0 * share);
  return text.data();
}

std::string Text(const ImageSize& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

// Share of the photo's pixels that a mask of any size excludes when it is laid over the upper left
// corner.
double ExcludedShareOf(const StaticMask& static_mask, const ImageSize& photo_size) {
  const int width = std::min(static_mask.width(), static_cast<int>(photo_size.width));
  const int height = std::min(static_mask.height(), static_cast<int>(photo_size.height));
  uint64_t num_kept = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) num_kept += static_mask(x, y) != 0 ? 1 : 0;
  }
  const double num_pixels =
      static_cast<double>(photo_size.width) * static_cast<double>(photo_size.height);
  return 1.0 - static_cast<double>(num_kept) / num_pixels;
}

class Inspector {
 public:
  Inspector(const fs::path& photo_path,
            const ImageSize& photo_size,
            const fs::path& mask_path,
            const MaskBehaviour& behaviour,
            LintImage& image,
            std::vector<LintFinding>& findings)
      : photo_path_(photo_path),
        photo_size_(photo_size),
        mask_path_(mask_path),
        behaviour_(behaviour),
        image_(image),
        findings_(findings) {}

  MaskInspection Run() {
    MaskInspection inspection;
    MaskContent content;
    try {
      content = ReadMaskContent(mask_path_);
    } catch (const Error& error) {
      AddUnreadable(error.what());
      return inspection;
    }
    CheckFormat(content);
    CheckValues(content);
    CheckShape(SizeOf(content.values));
    if (image_.effect == MaskEffect::kPhotoDropped && IsSixteenBitColour(content)) {
      return inspection;
    }
    inspection.static_mask = std::move(content.values);
    for (uint8_t& value : inspection.static_mask.data()) value = value == 0 ? 0 : 255;
    inspection.has_photo_size = SizeOf(inspection.static_mask) == photo_size_;
    const double share = ExcludedShareOf(inspection.static_mask, photo_size_);
    if (image_.effect == MaskEffect::kApplied) image_.excluded_share = share;
    if (inspection.has_photo_size && !IsAlphaOnly(content)) {
      if (share == 1.0) Add(LintCode::kAllExcluded);
      if (share == 0.0) Add(LintCode::kNothingExcluded);
    }
    if (share > 0.0 && share < 1.0) inspection.fingerprint = Fingerprint(inspection.static_mask);
    return inspection;
  }

 private:
  void Add(LintCode code, const std::string& detail = {}) {
    findings_.push_back(MakeFinding(code, image_.name, detail));
  }

  void Drop() {
    if (image_.effect == MaskEffect::kApplied) image_.effect = MaskEffect::kPhotoDropped;
  }

  void AddUnreadable(const std::string& why) {
    const MappedFile file(mask_path_);
    if (IsTruncated(file.bytes())) {
      Add(LintCode::kTruncatedMask);
      if (!behaviour_.reads_with_newer_codec) Drop();
      image_.excluded_share = std::numeric_limits<double>::quiet_NaN();
      return;
    }
    Add(LintCode::kUnreadableMask, why);
    Drop();
  }

  static bool IsSixteenBitColour(const MaskContent& content) {
    return content.format && content.format->bit_depth == 16 &&
           (content.format->colour == PngColour::kRgb ||
            content.format->colour == PngColour::kRgbWithAlpha);
  }

  void CheckFormat(const MaskContent& content) {
    if (IsSixteenBitColour(content)) {
      Add(LintCode::kSixteenBitColour);
      if (!behaviour_.reads_with_newer_codec) Drop();
    } else if (content.format && content.format->bit_depth == 16) {
      Add(LintCode::kSixteenBitGray);
    } else if (content.has_colours) {
      Add(LintCode::kColourMask);
    }
  }

  void CheckValues(const MaskContent& content) {
    if (IsAlphaOnly(content)) {
      Add(LintCode::kAlphaOnly,
          content.values.data().front() == 0 ? "COLMAP excludes the whole photo"
                                             : "COLMAP excludes nothing");
      return;
    }
    if (content.alpha && !SaysTheSame(*content.alpha, content.values)) {
      Add(LintCode::kAlphaIgnored);
    }
    std::array<uint64_t, 256> histogram = {};
    for (const uint8_t value : content.values.data()) ++histogram[value];
    const auto sum = [&](int begin, int end) {
      uint64_t total = 0;
      for (int value = begin; value < end; ++value) total += histogram[static_cast<size_t>(value)];
      return total;
    };
    const uint64_t num_between = sum(1, 255);
    const auto num_levels = std::count_if(
        histogram.begin() + 1, histogram.end(), [](uint64_t count) { return count > 0; });
    if (num_between == 0 || num_levels == 1) return;  // 0 and 1 are as good as 0 and 255
    Add(LintCode::kSoftMask,
        std::to_string(num_between) + " pixels (" +
            Percent(static_cast<double>(num_between) /
                    static_cast<double>(content.values.data().size())) +
            ") lie between, of which " + std::to_string(sum(1, kHalf)) +
            " below 128 are kept all the same");
  }

  void CheckShape(const ImageSize& mask_size) {
    const int orientation = ReadExifOrientation(photo_path_);
    const std::string sizes = Text(mask_size) + ", the photo " + Text(photo_size_);
    const std::string exif = "EXIF orientation " + std::to_string(orientation);
    switch (ShapeOf(mask_size, photo_size_, orientation)) {
      case MaskShape::kSame:
        if (orientation != 1) Add(LintCode::kTurnedPhoto, exif);
        break;
      case MaskShape::kScaled:
        Add(LintCode::kScaledMask, sizes);
        break;
      case MaskShape::kRotated:
        Add(LintCode::kRotatedMask, sizes + ", " + exif);
        break;
      case MaskShape::kOther:
        Add(LintCode::kWrongSize, sizes);
    }
  }

  static size_t Fingerprint(const StaticMask& static_mask) {
    const std::string_view bytes(reinterpret_cast<const char*>(static_mask.data().data()),
                                 static_mask.data().size());
    return std::hash<std::string_view>()(bytes) ^ static_cast<size_t>(static_mask.width());
  }

  const fs::path& photo_path_;
  const ImageSize& photo_size_;
  const fs::path& mask_path_;
  const MaskBehaviour& behaviour_;
  LintImage& image_;
  std::vector<LintFinding>& findings_;
};

}  // namespace

MaskContent ReadMaskContent(const fs::path& path) {
  MaskContent content;
  {
    const MappedFile file(path);
    content.format = ParsePngFormat(file.bytes());
  }
  const bool is_gray = content.format && content.format->colour == PngColour::kGray;
  const bool has_sixteen_bits = content.format && content.format->bit_depth == 16;
  if (!has_sixteen_bits) content.values = ReadMaskValues(path);
  if (!is_gray || has_sixteen_bits) {
    const RgbImage image = ReadRgbImage(path);
    content.has_colours =
        std::any_of(image.data().begin(), image.data().end(), [](const Rgb& pixel) {
          return pixel[0] != pixel[1] || pixel[1] != pixel[2];
        });
    if (has_sixteen_bits) {
      content.values = GrayImage(image.width(), image.height());
      std::transform(
          image.data().begin(),
          image.data().end(),
          content.values.data().begin(),
          [](const Rgb& pixel) { return *std::max_element(pixel.begin(), pixel.end()); });
    }
  }
  if (!is_gray) content.alpha = ReadAlpha(path);
  if (content.alpha && IsConstant(*content.alpha)) content.alpha.reset();
  return content;
}

bool IsAlphaOnly(const MaskContent& content) { return content.alpha && IsConstant(content.values); }

StaticMask MeantMask(const MaskContent& content) {
  StaticMask static_mask = IsAlphaOnly(content) ? *content.alpha : content.values;
  auto& values = static_mask.data();
  const bool has_high_values =
      std::any_of(values.begin(), values.end(), [](uint8_t value) { return value >= kHalf; });
  const int least_kept = has_high_values ? kHalf : 1;
  for (uint8_t& value : values) value = value >= least_kept ? 255 : 0;
  return static_mask;
}

MaskShape ShapeOf(const ImageSize& mask_size, const ImageSize& photo_size, int orientation) {
  if (mask_size == photo_size) return MaskShape::kSame;
  if (mask_size == ImageSize{photo_size.height, photo_size.width}) return MaskShape::kRotated;
  if (IsScaled(mask_size, photo_size)) return MaskShape::kScaled;
  const ImageSize upright = UprightSize(orientation, photo_size);
  return IsScaled(mask_size, upright) ? MaskShape::kRotated : MaskShape::kOther;
}

MaskInspection InspectMask(const fs::path& photo_path,
                           const ImageSize& photo_size,
                           const fs::path& mask_path,
                           const MaskBehaviour& behaviour,
                           LintImage& image,
                           std::vector<LintFinding>& findings) {
  return Inspector(photo_path, photo_size, mask_path, behaviour, image, findings).Run();
}

}  // namespace vgtw
