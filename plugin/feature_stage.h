// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/colmap_database.h"
#include "matching/extract.h"

#include <filesystem>

namespace vgtw {

struct FeatureStageOptions {
  std::filesystem::path image_path;
  std::filesystem::path mask_path;  // COLMAP masks, one per photo; "" = nothing is excluded
  ExtractOptions extract;
};

// Writes features of all images of a database, which has images and cameras. One transaction.
// Throws Error if a photo or mask is missing, unreadable or not of the camera's size.
void ExtractDatabaseFeatures(const FeatureStageOptions& options, ColmapDatabase& database);

}  // namespace vgtw
