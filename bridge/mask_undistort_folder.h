// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/mask_files.h"
#include "scene/progress.h"

#include <filesystem>
#include <vector>

namespace vgtw {

struct UndistortMasksOptions {
  bool overwrite = false;  // replace an existing output folder
  // Go on if an image has no mask (all that its photo shows is then kept); else that is an Error.
  bool allow_missing_masks = false;
  int num_threads = 0;  // 0 = all cores
};

// Masks for the images that `colmap image_undistorter` wrote (which does not undistort masks), as
// its stereo_fusion and splatting trainers need them: one per image of FindUndistortedImages, named
// by MaskPath; see UndistortMask. `mask_folder` holds the masks of the original photos,
// `model_folder` the sparse model before undistortion. Without `undistorted_folder` ("") every
// camera must be SIMPLE_PINHOLE or PINHOLE, which image_undistorter leaves as they are, and the
// masks are those of the photos. The folder appears complete or not at all. Throws Error if a model
// is unreadable, an undistorted image is not in the model before or has another aspect than its
// camera, or a mask is missing, unreadable or not of its photo's size.
std::vector<MaskSummary> UndistortMasks(const std::filesystem::path& mask_folder,
                                        const std::filesystem::path& model_folder,
                                        const std::filesystem::path& undistorted_folder,
                                        const std::filesystem::path& output_folder,
                                        const UndistortMasksOptions& options = {},
                                        const ProgressCallback& progress = {});

}  // namespace vgtw
