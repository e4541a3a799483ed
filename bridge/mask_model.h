// SPDX-License-Identifier: BSD-3-Clause
// What ApplyMasks does to a sparse model, by rule.
#pragma once

#include "bridge/mask_apply_images.h"
#include "scene/reconstruction.h"

#include <filesystem>
#include <vector>

namespace vgtw {

// Removes the observations of excluded keypoints and the points that keep fewer than two, under
// kTracks every point that had one; under kKeypoints also the points2D themselves, so that the
// others have the indices that the database then gives them. Errors of points that lost an
// observation are those of what remains. Throws Error (naming `model_path`) if the model's images
// are not those of the database, or their points2D not its keypoints; an image without any is fine.
ApplyMasksModelSummary MaskModel(const std::filesystem::path& model_path,
                                 const std::vector<MaskedImage>& images,
                                 MaskRule rule,
                                 Reconstruction& reconstruction);

}  // namespace vgtw
