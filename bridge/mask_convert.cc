// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_convert.h"

#include "bridge/import_photos.h"
#include "bridge/mask_resample.h"
#include "scene/error.h"
#include "scene/exif_orientation.h"
#include "scene/files.h"
#include "scene/image_io.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <system_error>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

using MaskFiles = std::vector<std::vector<fs::path>>;

// 255 where a pixel is marked.
StaticMask ReadMarks(const MaskConvention& convention, const fs::path& path) {
  StaticMask marks = ReadStaticMask(path);  // refuses 16 bits, whose low byte would be lost below
  if (convention.mark == MaskMark::kNonZero) return marks;
  const int least_value = convention.mark == MaskMark::kHalf ? 128 : 1;
  const RgbImage image = ReadRgbImage(path);
  std::transform(
      image.data().begin(), image.data().end(), marks.data().begin(), [&](const Rgb& value) {
        return static_cast<uint8_t>(
            *std::max_element(value.begin(), value.end()) >= least_value ? 255 : 0);
      });
  return marks;
}

// The map into what DUSt3R's loader makes of a photo: longest side resized to 512, then sides
// cropped around the centre to multiples of 16, and squares to 4:3. nullopt if that has another
// size.
std::optional<PixelMap> Dust3rFromPhoto(const ImageSize& photo, const ImageSize& mask) {
  constexpr double kLongestSide = 512.0;
  const auto w = static_cast<double>(photo.width);
  const auto h = static_cast<double>(photo.height);
  // Python rounds halves to even, as nearbyint does.
  const auto resized_w = static_cast<int>(std::nearbyint(w * kLongestSide / std::max(w, h)));
  const auto resized_h = static_cast<int>(std::nearbyint(h * kLongestSide / std::max(w, h)));
  const int half_w = resized_w / 2 * 2 / 16 * 8;
  const int half_h = resized_w == resized_h ? 3 * half_w / 4 : resized_h / 2 * 2 / 16 * 8;
  if (mask != ImageSize{static_cast<uint64_t>(2 * half_w), static_cast<uint64_t>(2 * half_h)}) {
    return std::nullopt;
  }
  PixelMap map = ScaleMap(resized_w / w, resized_h / h);
  map.col(2) << half_w - resized_w / 2, half_h - resized_h / 2;
  return map;
}

// The map from the photo (in the convention's frame) into a mask file, by the rule of sizes.
PixelMap MaskFromPhoto(const MaskConvention& convention,
                       const fs::path& path,
                       const ImageSize& mask,
                       const ImageSize& photo) {
  const bool differs = mask != photo;
  if (differs && convention.size == MaskSize::kDust3r) {
    if (const auto map = Dust3rFromPhoto(photo, mask)) return *map;
  }
  if (differs && convention.size == MaskSize::kScaled && IsScaled(mask, photo)) {
    return ScaleMap(static_cast<double>(mask.width) / static_cast<double>(photo.width),
                    static_cast<double>(mask.height) / static_cast<double>(photo.height));
  }
  CheckSize(path,
            mask,
            photo,
            convention.frame == MaskFrame::kUpright ? "the size of its photo upright"
                                                    : "the size of its photo",
            std::string(convention.tool) + (convention.size == MaskSize::kPhoto
                                                ? " does not resize masks"
                                                : " would not make such a mask of this photo"));
  return IdentityPixelMap();
}

int OrientationFor(const MaskConvention& convention, const fs::path& photo_path) {
  return convention.frame == MaskFrame::kUpright ? ReadExifOrientation(photo_path) : 1;
}

// A mask of the stored photo's size, as the file of a convention.
StaticMask Encoded(const MaskConvention& convention,
                   const StaticMask& static_mask,
                   const fs::path& photo_path) {
  const ImageSize size = SizeOf(static_mask);
  const int orientation = OrientationFor(convention, photo_path);
  StaticMask file = Resample(
      static_mask, Inverse(UprightFromStored(orientation, size)), UprightSize(orientation, size));
  if (convention.polarity == MaskPolarity::kMarkedIsExcluded) Invert(file);
  return file;
}

// The photos of a folder in which masks may lie, too.
std::vector<Photo> ListPhotosOnly(const fs::path& image_folder,
                                  const fs::path& mask_folder,
                                  const MaskConvention& from,
                                  int num_threads) {
  std::vector<Photo> photos = ListPhotos(image_folder, num_threads);
  if (!IsInFolder(image_folder, mask_folder)) return photos;
  const bool is_same = fs::equivalent(image_folder, mask_folder);
  std::vector<std::string> names;
  for (const Photo& photo : photos) names.push_back(photo.name);
  const std::vector<std::string> mask_names = MaskNames(from, names);
  const std::set<std::string> masks(mask_names.begin(), mask_names.end());
  std::erase_if(photos, [&](const Photo& photo) {
    return is_same ? masks.contains(photo.name)
                   : IsInFolder(mask_folder, image_folder / photo.name);
  });
  if (photos.empty()) Fail(image_folder, "holds masks only", "photos");
  return photos;
}

void CheckFound(const MaskConvention& from,
                const fs::path& mask_folder,
                const std::vector<std::string>& names,
                const MaskFiles& files) {
  const auto has_none = [](const std::vector<fs::path>& of_photo) { return of_photo.empty(); };
  const auto first_missing = std::find_if(files.begin(), files.end(), has_none);
  const bool all_missing = std::all_of(files.begin(), files.end(), has_none);
  if (first_missing == files.end() || (!all_missing && from.missing == MissingMask::kAllKept)) {
    return;
  }
  const auto idx = static_cast<size_t>(first_missing - files.begin());
  const std::string expected = MaskNames(from, names)[idx];
  if (!all_missing) {
    Fail(mask_folder / expected,
         "is missing",
         "a mask for every photo, which " + std::string(from.tool) + " needs",
         "add it, or remove the photo " + Printable(names[idx]));
  }
  const auto guess = GuessConvention(mask_folder, names);
  Fail(mask_folder,
       "holds no mask of these photos in the convention " + std::string(from.id),
       Printable(expected),
       guess ? "its names look like --from " + std::string(guess->convention->id) : "");
}

void CheckTargets(const MaskConvention& to,
                  const std::vector<std::string>& names,
                  const std::vector<std::string>& targets) {
  const auto stop = [&](const std::string& target, const std::string& why) {
    throw Error("mask " + Printable(target) + " in the convention " + std::string(to.id) + " " +
                why);
  };
  const std::set<std::string_view> photos(names.begin(), names.end());
  std::map<std::string_view, std::string_view> owners;
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string& target = targets[i];
    const auto [owner, is_new] = owners.emplace(target, names[i]);
    if (!is_new) {
      stop(target,
           "would be that of two photos, " + Printable(owner->second) + " and " +
               Printable(names[i]) + ", expected one; rename one of the photos");
    }
    if (!to.allows_spaces && target.find(' ') != std::string::npos) {
      stop(target,
           "has a space, expected none: " + std::string(to.tool) +
               " ignores such masks; rename the photo");
    }
    if (to.beside_photos && photos.contains(target)) {
      stop(target, "has the name of a photo beside which it must lie; rename the photo");
    }
  }
}

// PNG under any name, also "a.jpg".
void WritePng(const fs::path& folder, const std::string& name, const StaticMask& file, size_t idx) {
  // No photo's name begins with a dot, so that no mask of another one is overwritten.
  const fs::path temporary = folder / ("." + std::to_string(idx) + ".png");
  WriteImage(temporary, file);
  const fs::path path = folder / name;
  std::error_code code;
  fs::create_directories(path.parent_path(), code);
  if (!code) fs::rename(temporary, path, code);
  if (code) throw Error(Printable(path.string()) + ": cannot be written: " + code.message());
}

}  // namespace

StaticMask ReadMaskIn(const MaskConvention& convention,
                      const std::vector<fs::path>& files,
                      const fs::path& photo_path,
                      const ImageSize& photo_size) {
  StaticMask static_mask(
      static_cast<int>(photo_size.width), static_cast<int>(photo_size.height), 255);
  if (files.empty()) return static_mask;
  const int orientation = OrientationFor(convention, photo_path);
  const ImageSize upright_size = UprightSize(orientation, photo_size);
  const PixelMap upright_from_stored = UprightFromStored(orientation, photo_size);
  for (const fs::path& path : files) {
    StaticMask file = ReadMarks(convention, path);
    if (convention.polarity == MaskPolarity::kMarkedIsExcluded) Invert(file);
    const PixelMap mask_from_upright = MaskFromPhoto(convention, path, SizeOf(file), upright_size);
    const StaticMask part =
        Resample(file, Compose(mask_from_upright, upright_from_stored), photo_size);
    std::transform(part.data().begin(),
                   part.data().end(),
                   static_mask.data().begin(),
                   static_mask.data().begin(),
                   [](uint8_t a, uint8_t b) { return std::min(a, b); });
  }
  return static_mask;
}

std::vector<MaskSummary> ConvertMasks(const fs::path& image_folder,
                                      const fs::path& mask_folder,
                                      const fs::path& output_folder,
                                      const ConvertMasksOptions& options,
                                      const ProgressCallback& progress) {
  const MaskConvention& from = GetMaskConvention(options.from);
  const MaskConvention& to = GetMaskConvention(options.to);
  if (!to.writable) {
    throw Error("masks cannot be written as " + std::string(to.id) +
                ", which is the output of a segmenter, expected a convention of a tool that reads "
                "masks");
  }
  CheckNotInput(output_folder, image_folder);
  CheckNotInput(output_folder, mask_folder);
  const std::vector<Photo> photos =
      ListPhotosOnly(image_folder, mask_folder, from, options.num_threads);
  std::vector<std::string> names;
  for (const Photo& photo : photos) names.push_back(photo.name);
  const MaskFiles files = FindMasks(from, mask_folder, names);
  CheckFound(from, mask_folder, names, files);
  const std::vector<std::string> targets = MaskNames(to, names);
  CheckTargets(to, names, targets);

  AtomicFolder folder(output_folder, options.overwrite);
  std::vector<MaskSummary> summaries(photos.size());
  const auto convert = [&](int64_t i) {
    const auto idx = static_cast<size_t>(i);
    const fs::path photo_path = image_folder / names[idx];
    const StaticMask static_mask = ReadMaskIn(from, files[idx], photo_path, photos[idx].size);
    summaries[idx] = {names[idx], ExcludedShare(static_mask), files[idx].empty()};
    WritePng(folder.path(), targets[idx], Encoded(to, static_mask, photo_path), idx);
  };
  ParallelFor(static_cast<int64_t>(photos.size()), options.num_threads, convert, progress);
  folder.Commit();
  return summaries;
}

}  // namespace vgtw
