// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/predictions.h"
#include "scene/distractor_mask.h"
#include "scene/progress.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// COLMAP's name of an image's mask: "<mask folder>/<image name incl. extension>.png".
std::filesystem::path MaskPath(const std::filesystem::path& mask_folder,
                               const std::string& image_name);

struct MaskSummary {
  std::string image_name;
  double excluded_share = 0.0;  // of the image's pixels, in [0,1]
};

// Writes one mask per view, also an all-white one where nothing is excluded or nothing was
// predicted (COLMAP >= 3.12 drops images without one). Masks have the original image's size. The
// folder appears complete or not at all.
std::vector<MaskSummary> WriteMasks(const PredictionReader& predictions,
                                    const std::filesystem::path& mask_folder,
                                    const StaticMaskOptions& options,
                                    bool overwrite,
                                    int num_threads = 0,
                                    const ProgressCallback& progress = {});

}  // namespace vgtw
