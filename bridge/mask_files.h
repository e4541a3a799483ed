// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "scene/distractor_mask.h"
#include "scene/image_io.h"
#include "scene/progress.h"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// COLMAP's name of an image's mask: "<mask folder>/<image name incl. extension>.png".
std::filesystem::path MaskPath(const std::filesystem::path& mask_folder,
                               const std::string& image_name);

// A mask file as COLMAP reads it. Throws Error if it is unreadable or not of this size: COLMAP does
// not resize masks, a smaller one silently excludes what lies beyond it.
StaticMask ReadMaskOfSize(const std::filesystem::path& path, const ImageSize& size);

// The same before every value but 0 becomes 255.
GrayImage ReadMaskValuesOfSize(const std::filesystem::path& path, const ImageSize& size);

// Throws Error "<path>: has W x H pixels, expected W x H pixels, <whose>; <hint>" unless the sizes
// are the same.
void CheckSize(const std::filesystem::path& path,
               const ImageSize& size,
               const ImageSize& expected,
               std::string_view whose,
               std::string_view hint);

// Throws Error if the folder is missing or, with the first name and their number, if images have no
// mask in it though that is not allowed.
void CheckMasksExist(const std::filesystem::path& mask_folder,
                     const std::vector<std::string>& image_names,
                     bool allow_missing);

// Whether `path` is `folder` or lies below it; neither need exist.
bool IsInFolder(const std::filesystem::path& folder, const std::filesystem::path& path);

// Throws Error if `output_folder` is or holds `input_folder`, which is read.
void CheckNotInput(const std::filesystem::path& output_folder,
                   const std::filesystem::path& input_folder);

struct MaskSummary {
  std::string image_name;
  double excluded_share = 0.0;  // of the image's pixels, in [0,1]
  bool was_missing = false;     // there was nothing to make it from; it is all-white
};

// Fills the idx-th mask and says whose it is; excluded_share is set by WriteMaskFolder.
using MaskMaker = std::function<MaskSummary(size_t idx, StaticMask& static_mask)>;

// Writes `num_masks` masks named by MaskPath; `make` is called by `num_threads` threads at once.
// The folder appears complete or not at all, as by AtomicFolder.
std::vector<MaskSummary> WriteMaskFolder(const std::filesystem::path& mask_folder,
                                         bool overwrite,
                                         size_t num_masks,
                                         int num_threads,
                                         const ProgressCallback& progress,
                                         const MaskMaker& make);

// Writes one mask per view, also an all-white one where nothing is excluded or nothing was
// predicted (COLMAP >= 3.12 drops images without one). Masks have the original image's size. The
// folder appears complete or not at all.
std::vector<MaskSummary> WriteMasks(const PredictionReader& predictions,
                                    const std::filesystem::path& mask_folder,
                                    const StaticMaskOptions& options,
                                    bool overwrite,
                                    int num_threads = 0,
                                    const ProgressCallback& progress = {});

// Turns masks that were made elsewhere, named by MaskPath below `from_folder`, into a folder that
// every version of COLMAP reads: 8-bit, 0 or 255, one per name in `image_names` (all-white where
// `from_folder` has none). The folder appears complete or not at all. Throws Error if a mask is
// unreadable or not of its photo's size below `image_folder`.
std::vector<MaskSummary> CopyMasks(const std::filesystem::path& from_folder,
                                   const std::filesystem::path& image_folder,
                                   const std::vector<std::string>& image_names,
                                   const std::filesystem::path& mask_folder,
                                   bool overwrite,
                                   int num_threads = 0,
                                   const ProgressCallback& progress = {});

}  // namespace vgtw
