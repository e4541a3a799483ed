// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/mask_conventions.h"
#include "scene/progress.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Why masks do nothing, or something else than was meant, in COLMAP, which says little of it.

enum class LintSeverity {
  kNote,     // worth knowing
  kWarning,  // may be meant
  kError     // is not what anybody wants
};

// One kind of finding.
struct LintRule {
  std::string_view code;  // its word, for instance "scaled-mask"
  LintSeverity severity = LintSeverity::kNote;
  std::string_view meaning;  // what it is, and what COLMAP makes of it
  std::string_view advice;
};

// The table of all rules.
std::span<const LintRule> LintRules();

struct LintFinding {
  const LintRule* rule = nullptr;
  std::string name;    // of the photo, or of the mask file below the mask folder; "" = all of them
  std::string detail;  // the figures; may be ""
};

// What COLMAP does with a photo's mask.
enum class MaskEffect {
  kApplied,      // as far as its size and values go
  kUnused,       // no file is found under the names it tries; the whole photo is used
  kPhotoDropped  // the photo gets no row in the database
};

struct LintImage {
  std::string name;
  MaskEffect effect = MaskEffect::kUnused;
  // Its mask below the mask folder, found by COLMAP or not; several where a convention has one per
  // object, none where there is none.
  std::vector<std::string> mask_names;
  // The convention of mask_names where COLMAP does not find them and they are not named nearly as
  // it expects; else null.
  const MaskConvention* convention = nullptr;
  // Share of the photo's pixels that COLMAP excludes, in [0,1]: also those beyond a smaller mask. 0
  // if it uses no mask, NaN if the photo is dropped.
  double excluded_share = 0.0;
  bool is_in_database = false;
  uint64_t num_keypoints = 0;           // that the database holds
  uint64_t num_excluded_keypoints = 0;  // of them, on pixels that COLMAP would exclude
};

struct LintMasksOptions {
  std::filesystem::path database_path = {};  // "" = none
  std::string colmap_version = "3.8";        // whose behaviour is told; 3.8 or newer
  int num_threads = 0;                       // 0 = all cores
};

struct LintReport {
  std::vector<LintImage> images;      // sorted by name
  std::vector<LintFinding> findings;  // in the order of the table
  // The polarity of the folder is wrong beyond doubt (see "inverted-masks").
  bool is_inverted = false;

  size_t Count(LintSeverity severity) const;
};

// Looks at the masks of the photos below `image_folder`. Polarity is judged in two steps. Masks
// that exclude more than half of the typical photo are suspected. They are proven to be inverted
// only by a database with verified matches: if excluded keypoints take part in inlier matches that
// move between the photos at least twice as often as kept ones. Moving things do not fit the
// geometry of the scene; background that stands still in the frame, as behind a turntable, does not
// move in it, and so proves nothing.
// Throws Error if a folder is missing, there is no photo, the folder of masks is that of the
// photos, the database is damaged, or the version is not one. Damaged photos and masks are
// findings.
LintReport LintMasks(const std::filesystem::path& image_folder,
                     const std::filesystem::path& mask_folder,
                     const LintMasksOptions& options,
                     const ProgressCallback& progress = {});

struct FixMasksOptions {
  bool invert = false;     // exchange kept and excluded in every mask, whatever was judged
  bool overwrite = false;  // replace an existing output folder
  int num_threads = 0;     // 0 = all cores
};

struct MaskFix {
  std::string image_name;
  std::string what;       // was done, or why nothing could be; "" if only copied
  bool is_mended = true;  // false: all-white instead of a mask that cannot be understood
  double excluded_share = 0.0;
};

// Writes masks that every version of COLMAP reads as they were meant, one per photo of `report`,
// which LintMasks made of the same folders: named <photo name>.png, 8 bit, 0 or 255, of the stored
// photo's size. Turned upright ones are turned back, scaled ones take the nearest pixel, soft ones
// are cut at half, information in alpha becomes gray; masks under another tool's telling names are
// read by its convention. Polarity changes if `invert` says so or the report proves it, but not
// that of masks that exclude nothing. Where there is no mask, or none that can be mended, an
// all-white one is written and `what` says so. The folder appears complete or not at all and must
// not hold the photos or the masks that are read. Throws Error if a photo cannot be read.
std::vector<MaskFix> FixMasks(const std::filesystem::path& image_folder,
                              const std::filesystem::path& mask_folder,
                              const LintReport& report,
                              const std::filesystem::path& output_folder,
                              const FixMasksOptions& options,
                              const ProgressCallback& progress = {});

}  // namespace vgtw
