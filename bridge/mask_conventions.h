// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// How a tool names, reads and understands the masks of photos. A pixel of a mask is marked or not;
// the polarity says which of the two takes it out of the reconstruction.
enum class MaskPolarity { kMarkedIsKept, kMarkedIsExcluded };

enum class MaskMark {
  kNonZero,         // the gray value is not 0
  kNonZeroChannel,  // any channel is not 0: label images of any palette
  kHalf             // the gray value is 128 or more
};

enum class MaskSize {
  kPhoto,   // the photo's
  kScaled,  // any; the tool takes the nearest pixel
  kDust3r   // the photo's, or that of DUSt3R's loader: longest side 512, sides cropped to 16
};

// Law of a photo without a mask: it is used as a whole, or the tool does not run.
enum class MissingMask { kAllKept, kError };

// Whether masks lie over the photo's stored pixels or stand upright after its EXIF orientation.
enum class MaskFrame { kStored, kUpright };

struct MaskConvention {
  std::string_view id;    // the word on the command line
  std::string_view tool;  // as people call it
  // Names below the mask folder, the first for writing, all for reading; "" = no more. For a photo
  // sub/a.b.jpg: {name} sub/a.b.jpg, {dir} sub/, {base} a.b.jpg, {stem} a.b, {frame} its rank among
  // the photos by base name; */ stands for every sub-folder at once (one per object).
  std::array<std::string_view, 4> patterns = {};
  MaskPolarity polarity = MaskPolarity::kMarkedIsKept;
  MaskMark mark = MaskMark::kNonZero;
  MaskSize size = MaskSize::kPhoto;
  MissingMask missing = MissingMask::kAllKept;
  MaskFrame frame = MaskFrame::kStored;
  bool beside_photos = false;     // the tool looks in the photos' folder
  bool allows_spaces = true;      // in names
  bool writable = true;           // false: outputs of segmenters, only read
  std::string_view setting = {};  // what to set in the tool
  std::string_view source = {};   // where the row comes from, and what could not be verified
};

// The table, COLMAP first.
std::span<const MaskConvention> MaskConventions();

// Throws Error with the known words if there is none.
const MaskConvention& GetMaskConvention(std::string_view id);

// The mask to write for each photo, relative to the mask folder.
std::vector<std::string> MaskNames(const MaskConvention& convention,
                                   const std::vector<std::string>& image_names);

// The files that hold each photo's mask: none, one, or one per object. Throws Error if two photos
// share a file (a.jpg and a.png where the extension does not count).
std::vector<std::vector<std::filesystem::path>> FindMasks(
    const MaskConvention& convention,
    const std::filesystem::path& mask_folder,
    const std::vector<std::string>& image_names);

struct MaskCount {
  const MaskConvention* convention = nullptr;
  size_t num_found = 0;  // photos that find a mask
};

// What each convention finds in a folder, in the table's order. Only names are looked at: those
// that differ in polarity alone count the same.
std::vector<MaskCount> CountMasks(const std::filesystem::path& mask_folder,
                                  const std::vector<std::string>& image_names);

// The convention that finds most, the first of equals; nullopt if none finds any.
std::optional<MaskCount> GuessConvention(const std::filesystem::path& mask_folder,
                                         const std::vector<std::string>& image_names);

}  // namespace vgtw
