// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/progress.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace vgtw {

// What becomes of an excluded keypoint, that is one on a distractor.
enum class MaskRule {
  // It stays, its rows of matches and two-view geometries go: indices remain valid everywhere.
  kMatches,
  // It goes with its descriptor and its rows; the others are renumbered in their order, as if they
  // had been extracted with masks.
  kKeypoints,
  // As kMatches, and so do the rows of every keypoint that inlier matches of two-view geometries
  // link to it, directly or over other keypoints: its whole track.
  kTracks
};

struct ApplyMasksOptions {
  MaskRule rule = MaskRule::kMatches;
  // Excludes keypoints up to dilate_px + dilate_scale * (scale of the keypoint) pixels away from a
  // distractor, measured from the centre of their pixel to that of the nearest excluded one:
  // features look around themselves. Both >= 0. The scale is COLMAP's: the keypoint's third of 4
  // columns, or the mean length of the columns of the affine shape in 6; with 2 columns it is an
  // Error.
  int dilate_px = 0;
  double dilate_scale = 0.0;
  // A two-view geometry that lost rows and keeps fewer than this many inlier matches loses them
  // all. COLMAP's min_num_inliers of verification, below which it stores none, and min_num_matches
  // of its mapper, which ignores such pairs. >= 0.
  int min_num_inliers = 15;
  // A sparse model made from this database, and where to write it without its observations of
  // excluded keypoints; points left with one observation go, under kTracks every point that had an
  // excluded one. An image whose last geometry went keeps its pose alone, as COLMAP has it for
  // images without matches (3.8 aborts on others). Format as read. Both or none.
  std::filesystem::path model_path = {};
  std::filesystem::path model_output_path = {};
  // Keep the original of changed rows in the table vgtw_mask_undo, for RestoreMasks. Without, what
  // an earlier run kept is dropped, since it no longer fits.
  bool keep_undo = true;
  // Change `database_path` itself instead of writing a new file.
  bool in_place = false;
  // Replace an existing output database or model.
  bool overwrite = false;
  // Go on if an image has no mask (it then keeps everything); else that is an Error.
  bool allow_missing_masks = false;
  int num_threads = 0;  // for decoding masks; 0 = all cores

  void Check() const;
};

struct ApplyMasksImageSummary {
  std::string image_name;
  bool has_mask = false;
  uint64_t num_keypoints = 0;
  uint64_t num_excluded_keypoints = 0;
};

struct ApplyMasksModelSummary {
  uint64_t num_observations_before = 0;
  uint64_t num_observations_after = 0;
  uint64_t num_points3D_before = 0;
  uint64_t num_points3D_after = 0;
};

struct ApplyMasksSummary {
  std::vector<ApplyMasksImageSummary> images;  // sorted by name
  uint64_t num_linked_keypoints = 0;           // kept ones that share a track with excluded ones
  uint64_t num_matches_before = 0;             // rows of `matches`
  uint64_t num_matches_after = 0;
  uint64_t num_inlier_matches_before = 0;  // rows of `two_view_geometries`
  uint64_t num_inlier_matches_after = 0;
  uint64_t num_geometries_before = 0;  // pairs with inlier matches
  uint64_t num_geometries_after = 0;
  std::vector<std::string> disconnected_images;  // that lost their last geometry; sorted
  std::optional<ApplyMasksModelSummary> model;
};

// Takes distractors out of an existing database whatever extractor filled it, by the rule above.
// F, E, H and the pose of a geometry stay; one that loses its last inlier gets configuration 0, as
// COLMAP stores a pair without geometry. Rows are streamed; what grows with the number of images is
// one bit per keypoint, four bytes more under kKeypoints and kTracks, and the sparse model.
// Applying the same masks again changes nothing.
// One transaction; by default on a copy that is renamed to `output_path` at the end, so that a
// crash leaves the old or the new file. In place (`output_path` empty or the same file) a crash
// leaves the old or the new content once SQLite, that is COLMAP or this library, has opened it. The
// model appears, complete, just before the database changes.
// Throws Error, with nothing written, if a mask is missing, unreadable or not of its image's size,
// if the database is damaged or locked, if a match names a keypoint that does not exist, or if the
// model is not of this database.
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
