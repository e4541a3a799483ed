// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/mask_score.h"
#include "scene/progress.h"

#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct MaskScoresOptions {
  // Exactly one of these holds what is scored: COLMAP masks, or distractor probabilities that
  // become masks at `threshold`, in (0, 1], without any margin.
  std::filesystem::path mask_path;
  std::filesystem::path predictions_path;
  double threshold = 0.5;
  // True masks in COLMAP's naming; the images that have one are scored.
  std::filesystem::path reference_mask_path;
  // Of these alone, in place of all below the folder; then `image_path` must be given, and the true
  // masks may follow another convention (MaskConvention::id).
  std::vector<std::string> image_names = {};
  std::string reference_convention = "colmap";
  std::filesystem::path image_path;     // photos of which the true masks must have the size, or ""
  std::filesystem::path database_path;  // of features extracted without masks, or ""
  double tolerance_px = 0.0;            // of outlines, >= 0; 0 is DefaultBoundaryTolerancePx
  bool allow_missing_masks = false;     // go on without a mask to score: nothing is excluded
  int num_threads = 0;
};

struct ImageMaskScore {
  std::string name;
  MaskScore score;
};

// Sorted by name. Throws Error if a folder or the database is unreadable, an image is missing in
// one of them, or masks of an image differ in size.
std::vector<ImageMaskScore> ScoreMasks(const MaskScoresOptions& options,
                                       const ProgressCallback& progress = {});

}  // namespace vgtw
