// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_convert.h"
#include "bridge/mask_files.h"
#include "bridge/mask_lint.h"
#include "bridge/mask_lint_content.h"
#include "bridge/mask_resample.h"
#include "scene/error.h"
#include "scene/exif_orientation.h"
#include "scene/image_io.h"

#include <utility>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

void AddWords(std::string& text, const std::string& words) {
  text += (text.empty() ? "" : ", ") + words;
}

// Throws Error if there is no way to tell.
StaticMask Fitted(const StaticMask& static_mask,
                  const ImageSize& photo_size,
                  const fs::path& photo_path,
                  const fs::path& mask_path,
                  std::string& what) {
  const ImageSize size = SizeOf(static_mask);
  const int orientation = ReadExifOrientation(photo_path);
  const MaskShape shape = ShapeOf(size, photo_size, orientation);
  if (shape == MaskShape::kSame) return static_mask;
  const bool is_rotated = shape == MaskShape::kRotated;
  const ImageSize upright_size = UprightSize(orientation, photo_size);
  const ImageSize frame_size = is_rotated ? upright_size : photo_size;
  if (!IsScaled(size, frame_size)) {
    CheckSize(mask_path,
              size,
              photo_size,
              "the size of its photo",
              is_rotated ? "the photo's EXIF does not say how it was turned" : "make it again");
  }
  if (is_rotated) AddWords(what, "turned back as the photo is stored");
  if (size != frame_size) AddWords(what, "resized to the photo");
  const PixelMap mask_from_frame =
      ScaleMap(static_cast<double>(size.width) / static_cast<double>(frame_size.width),
               static_cast<double>(size.height) / static_cast<double>(frame_size.height));
  const PixelMap frame_from_stored =
      is_rotated ? UprightFromStored(orientation, photo_size) : IdentityPixelMap();
  return Resample(static_mask, Compose(mask_from_frame, frame_from_stored), photo_size);
}

class Fixer {
 public:
  Fixer(const fs::path& image_folder, const fs::path& mask_folder, bool inverts)
      : image_folder_(image_folder), mask_folder_(mask_folder), inverts_(inverts) {}

  // A damaged mask is no Error, a damaged photo is.
  StaticMask Make(const LintImage& image, MaskFix& fix) const {
    const fs::path photo_path = image_folder_ / image.name;
    const ImageSize size = ReadImageSize(photo_path);
    const StaticMask all_white(static_cast<int>(size.width), static_cast<int>(size.height), 255);
    if (image.mask_names.empty()) {
      fix.what = "there was none: all-white";
      return all_white;
    }
    try {
      return image.convention == nullptr ? FromColmap(image, photo_path, size, fix)
                                         : FromConvention(image, photo_path, size, fix);
    } catch (const Error& error) {
      fix.is_mended = false;
      fix.what = "all-white instead: " + std::string(error.what());
      return all_white;
    }
  }

 private:
  StaticMask FromConvention(const LintImage& image,
                            const fs::path& photo_path,
                            const ImageSize& size,
                            MaskFix& fix) const {
    std::vector<fs::path> files;
    for (const std::string& name : image.mask_names) files.push_back(mask_folder_ / name);
    AddWords(fix.what, "read as " + std::string(image.convention->tool) + " does");
    return MaybeInverted(ReadMaskIn(*image.convention, files, photo_path, size), fix);
  }

  StaticMask FromColmap(const LintImage& image,
                        const fs::path& photo_path,
                        const ImageSize& size,
                        MaskFix& fix) const {
    const std::string& name = image.mask_names.front();
    const fs::path mask_path = mask_folder_ / name;
    const MaskContent content = ReadMaskContent(mask_path);
    if (name != image.name + ".png") AddWords(fix.what, "renamed from " + name);
    if (IsAlphaOnly(content)) AddWords(fix.what, "taken from alpha");
    const StaticMask meant = MeantMask(content);
    if (!IsAlphaOnly(content) && meant != AsColmapReads(content)) {
      AddWords(fix.what, "cut at 128");
    }
    return MaybeInverted(Fitted(meant, size, photo_path, mask_path, fix.what), fix);
  }

  static StaticMask AsColmapReads(const MaskContent& content) {
    StaticMask static_mask = content.values;
    for (uint8_t& value : static_mask.data()) value = value == 0 ? 0 : 255;
    return static_mask;
  }

  StaticMask MaybeInverted(StaticMask static_mask, MaskFix& fix) const {
    const double share = ExcludedShare(static_mask);
    if (inverts_ && share > 0.0) {
      Invert(static_mask);
      AddWords(fix.what, "kept and excluded exchanged");
    } else if (inverts_) {
      // Among inverted masks it would exclude the whole photo, and is rather one that was added
      // where none was made.
      AddWords(fix.what, "excludes nothing: not exchanged");
    } else if (share == 1.0) {
      AddWords(fix.what, "excludes the whole photo, left so");
    }
    return static_mask;
  }

  const fs::path& image_folder_;
  const fs::path& mask_folder_;
  const bool inverts_;
};

}  // namespace

std::vector<MaskFix> FixMasks(const fs::path& image_folder,
                              const fs::path& mask_folder,
                              const LintReport& report,
                              const fs::path& output_folder,
                              const FixMasksOptions& options,
                              const ProgressCallback& progress) {
  CheckNotInput(output_folder, image_folder);
  CheckNotInput(output_folder, mask_folder);
  const Fixer fixer(image_folder, mask_folder, options.invert || report.is_inverted);
  std::vector<MaskFix> fixes(report.images.size());
  const auto make = [&](size_t idx, StaticMask& static_mask) {
    fixes[idx].image_name = report.images[idx].name;
    static_mask = fixer.Make(report.images[idx], fixes[idx]);
    fixes[idx].excluded_share = ExcludedShare(static_mask);
    return MaskSummary{.image_name = fixes[idx].image_name};
  };
  WriteMaskFolder(
      output_folder, options.overwrite, fixes.size(), options.num_threads, progress, make);
  return fixes;
}

}  // namespace vgtw
