// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/mask_conventions.h"
#include "bridge/mask_files.h"
#include "scene/progress.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct ConvertMasksOptions {
  std::string from = "colmap";  // MaskConvention::id of the masks that are there
  std::string to = "colmap";    // of those to write; must be writable
  bool overwrite = false;       // replace an existing output folder
  int num_threads = 0;          // 0 = all cores
};

// A mask in one convention as COLMAP means it: the stored photo's size, 0 where excluded. `files`
// as FindMasks gives them; all-white if there is none. What a mask does not cover (DUSt3R's crop)
// is kept. Throws Error if a file is unreadable, has 16 bits or a size that the convention forbids.
StaticMask ReadMaskIn(const MaskConvention& convention,
                      const std::vector<std::filesystem::path>& files,
                      const std::filesystem::path& photo_path,
                      const ImageSize& photo_size);

// Writes the masks of all photos below `image_folder` in another convention: 8-bit gray PNG of the
// photo's size, 0 or 255, one per photo (also where there was none, which then excludes nothing).
// Lossless: back in the first convention every pixel is as it was read. `output_folder` appears
// complete or not at all and must not hold the photos or the masks that are read; masks in the
// photos' folder are told from photos by their names.
// Throws Error if no photo has a mask, if one lacks it that the convention demands, if two photos
// would share a mask, or if the tool would not find a mask under its name.
std::vector<MaskSummary> ConvertMasks(const std::filesystem::path& image_folder,
                                      const std::filesystem::path& mask_folder,
                                      const std::filesystem::path& output_folder,
                                      const ConvertMasksOptions& options,
                                      const ProgressCallback& progress = {});

}  // namespace vgtw
