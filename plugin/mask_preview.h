// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/image_io.h"
#include "scene/progress.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// The photo at `width` pixels, what its mask excludes tinted magenta inside a white line. Throws
// std::invalid_argument if the mask is not of the photo's size.
RgbImage DrawMaskOverlay(const RgbImage& photo, const StaticMask& static_mask, int width);

struct MaskPreviewOptions {
  int num_columns = 4;      // photos side by side, > 0
  int num_rows = 6;         // on a page, > 0
  int tile_width_px = 400;  // of a photo, > 0
  bool overwrite = false;   // replace existing files
  int num_threads = 0;
  void Check() const;
};

struct PreviewedMask {
  std::string image_name;
  bool has_mask = false;
  double excluded_share = 0.0;  // of the photo's pixels, in [0,1]
};

struct MaskPreview {
  std::vector<PreviewedMask> images;         // sorted by name
  std::vector<std::filesystem::path> pages;  // as written
};

// Draws every photo below `image_folder` with its COLMAP mask (photos without one are shown as they
// are) under its name and excluded share. One page is `output_path` itself (.png or .jpg), more are
// <stem>_1, <stem>_2, ... beside it; memory is that of a page. Throws Error if a file exists, or is
// unreadable, or a mask is not of its photo's size.
MaskPreview WriteMaskPreview(const std::filesystem::path& image_folder,
                             const std::filesystem::path& mask_folder,
                             const std::filesystem::path& output_path,
                             const MaskPreviewOptions& options,
                             const ProgressCallback& progress = {});

}  // namespace vgtw
