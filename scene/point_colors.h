// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"
#include "scene/reconstruction.h"

#include <filesystem>
#include <span>

namespace vgtw {

// Gives each point of the models the mean colour of the pixels at its observations. A photo is read
// once for all models, which have the same images; one per thread is in memory at a time.
// Observations outside of their photo, and photos that `image_path` lacks, do not count; points
// without any others stay as they are. Throws Error if a photo cannot be read.
void ColorPoints(const std::filesystem::path& image_path,
                 std::span<Reconstruction* const> models,
                 int num_threads = 0,
                 const ProgressCallback& progress = {});
void ColorPoints(const std::filesystem::path& image_path,
                 Reconstruction& model,
                 int num_threads = 0,
                 const ProgressCallback& progress = {});

}  // namespace vgtw
