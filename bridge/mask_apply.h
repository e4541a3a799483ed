// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct ApplyMasksOptions {
  // Change `database_path` itself instead of writing a new file.
  bool in_place = false;
  // Replace an existing output database.
  bool overwrite = false;
  // Go on if an image has no mask (it then keeps everything); else that is an Error.
  bool allow_missing_masks = false;
  int num_threads = 0;  // for decoding masks; 0 = all cores
};

struct ApplyMasksImageSummary {
  std::string image_name;
  bool has_mask = false;
  uint64_t num_keypoints = 0;
  uint64_t num_excluded_keypoints = 0;
};

struct ApplyMasksSummary {
  std::vector<ApplyMasksImageSummary> images;  // sorted by name
  uint64_t num_matches_before = 0;             // rows of `matches`
  uint64_t num_matches_after = 0;
  uint64_t num_inlier_matches_before = 0;  // rows of `two_view_geometries`
  uint64_t num_inlier_matches_after = 0;
};

// Takes distractors out of an existing database whatever extractor filled it: keypoints and
// descriptors stay (indices remain valid for every model), rows of matches and two-view geometries
// with an endpoint in an excluded pixel go. F, E, H and the pose of a geometry stay; one that loses
// its last inlier gets configuration 0, as COLMAP stores a pair without geometry. Pairs are
// streamed, so memory does not grow with the number of images (masks are kept as one bit per
// keypoint). Applying the same masks again changes nothing.
// One transaction; by default on a copy that is renamed to `output_path` at the end, so that a
// crash leaves the old or the new file. In place (`output_path` empty or the same file) a crash
// leaves the old or the new content once SQLite, that is COLMAP or this library, has opened it.
// Throws Error, with nothing written, if a mask is missing, unreadable or not of its image's size,
// if the database is damaged or locked, or if a match names a keypoint that does not exist.
ApplyMasksSummary ApplyMasks(const std::filesystem::path& database_path,
                             const std::filesystem::path& mask_folder,
                             const std::filesystem::path& output_path,
                             const ApplyMasksOptions& options,
                             const ProgressCallback& progress = {});

// Per image, sorted by name, its keypoints and those in excluded pixels; changes nothing. An image
// without a mask counts as kept, all of them if `mask_folder` is "". Throws Error as ApplyMasks.
std::vector<ApplyMasksImageSummary> CountExcludedKeypoints(
    const std::filesystem::path& database_path,
    const std::filesystem::path& mask_folder,
    int num_threads = 0);

}  // namespace vgtw
