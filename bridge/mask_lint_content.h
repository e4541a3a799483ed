// SPDX-License-Identifier: BSD-3-Clause
// What a mask file holds, as COLMAP reads it and as it was meant. Not a door.
#pragma once

#include "bridge/mask_lint.h"
#include "bridge/mask_lint_names.h"
#include "scene/image_header.h"
#include "scene/image_io.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

struct MaskContent {
  std::optional<PngFormat> format;  // nullopt: a JPEG or the like, whatever its name says
  GrayImage values;                 // gray; of 16 bits the upper 8
  std::optional<GrayImage> alpha;   // where it is not the same everywhere
  bool has_colours = false;
};

// Throws Error if the file cannot be decoded.
MaskContent ReadMaskContent(const std::filesystem::path& path);

// Whether all information is in the alpha channel.
bool IsAlphaOnly(const MaskContent& content);

// The mask in mind, at the file's size: alpha where it holds it all; values from 128 on are kept,
// or all but 0 in a mask without such values (labels 0, 1, 2, ...).
StaticMask MeantMask(const MaskContent& content);

// How a mask of another size than its photo's may have come about.
enum class MaskShape { kSame, kScaled, kRotated, kOther };

// `orientation` as EXIF's, see scene/exif_orientation.h. kRotated: of the upright photo's shape.
MaskShape ShapeOf(const ImageSize& mask_size, const ImageSize& photo_size, int orientation);

// Facts of one photo and its mask that judgements of the whole folder need.
struct MaskInspection {
  // As COLMAP would read it if it finds it, at the file's size; empty if it would not.
  StaticMask static_mask;
  bool has_photo_size = false;
  size_t fingerprint = 0;  // of the mask; 0 where it excludes nothing or everything
};

// Looks at a mask that is named as COLMAP's or nearly so; completes `image`, adds to `findings`.
MaskInspection InspectMask(const std::filesystem::path& photo_path,
                           const ImageSize& photo_size,
                           const std::filesystem::path& mask_path,
                           const MaskBehaviour& behaviour,
                           LintImage& image,
                           std::vector<LintFinding>& findings);

}  // namespace vgtw
