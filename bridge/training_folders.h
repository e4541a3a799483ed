// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/mask_lint.h"
#include "scene/image_io.h"
#include "scene/progress.h"
#include "scene/scene_stream.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace vgtw {

// What `vgtw train` learns from: scenes of photos, each photo with the mask of its distractors
// under COLMAP's name (bridge/mask_files.h; 0 = distractor, all else static).

struct TrainingScene {
  std::string name;  // of its folder; "" where all photos are one scene
  std::filesystem::path image_path;
  std::filesystem::path mask_path;
};

// Law: photos right in `image_path` make it one scene, with all that lie deeper; else each folder
// in it is a scene, and the folder of the same name in `mask_path` holds its masks. Hidden folders
// are none. Sorted by name byte-wise. Throws Error if `image_path` is no folder, holds neither
// photos nor folders, or a folder's name is not printable.
std::vector<TrainingScene> FindTrainingScenes(const std::filesystem::path& image_path,
                                              const std::filesystem::path& mask_path);

struct TrainingFolderOptions {
  // Of the network's images, px, multiples of 14 up to 4096; the trainer's unless set.
  int width = SceneStreamOptions().width;
  int height = SceneStreamOptions().height;
  int num_threads = 0;  // 0 = all cores

  void Check() const;
};

struct SceneCheck {
  TrainingScene scene;
  size_t num_photos = 0;
  size_t num_masks = 0;  // of these photos, under the name that is read
  // Of the photos' pixels, mean over photos, in [0,1]; NaN where there are errors.
  double distractor_share = std::numeric_limits<double>::quiet_NaN();
  std::vector<LintFinding> findings;  // in the order of TrainingRules(); "" = the whole scene

  size_t Count(LintSeverity severity) const;
};

// What is wrong for training. Errors are what the trainer stops at, at its start or in the middle
// of a run; warnings are what it learns badly from and does not say.
std::span<const LintRule> TrainingRules();

// Reads all photos and masks. Masks are judged by LintMasks (bridge/mask_lint.h), whose codes the
// findings keep; what is added is about training: scenes of fewer than two photos, photos that do
// not decode, photos with fewer rows or columns than the network sees, scenes of which more than
// 95 % is distractor. Whatever is wrong in a scene is a finding.
std::vector<SceneCheck> CheckTrainingScenes(const std::vector<TrainingScene>& scenes,
                                            const TrainingFolderOptions& options,
                                            const ProgressCallback& progress = {});

// Of a scene or of all. A view is a photo whose mask can be read and has its size. Shares are of
// distractors, in [0,1], NaN without views.
struct TrainingStats {
  size_t num_photos = 0;
  size_t num_views = 0;
  std::vector<std::pair<ImageSize, size_t>> sizes;  // of views, the most frequent first
  double mean_share =
      std::numeric_limits<double>::quiet_NaN();  // of pixels, each view counts alike
  double min_share = std::numeric_limits<double>::quiet_NaN();
  double max_share = std::numeric_limits<double>::quiet_NaN();
  size_t num_without_distractor = 0;  // views
  // Patches of 14 x 14 px at the network's size by the trainer's labels: distractor where more than
  // half of it is, static where less than a tenth is, else mixed and left out of the losses of
  // features.
  uint64_t num_distractor_patches = 0;
  uint64_t num_static_patches = 0;
  uint64_t num_mixed_patches = 0;
};

struct SceneStats {
  TrainingScene scene;
  TrainingStats stats;
};

struct TrainingFolderStats {
  std::vector<SceneStats> scenes;
  TrainingStats total;
};

// Reads all masks, and of photos the size alone. Patches are those of the largest cut of the
// network's shape in the middle of the photo, with exact shares of area; the trainer's own cuts are
// 0.8 to 1 times as large and lie anywhere. Throws Error if a scene has no photo.
TrainingFolderStats ComputeTrainingStats(const std::vector<TrainingScene>& scenes,
                                         const TrainingFolderOptions& options,
                                         const ProgressCallback& progress = {});

struct CorruptMasksOptions {
  double share = 0.1;      // in [0,1], of the masks that hold a distractor
  uint64_t seed = 0;       // of the choice
  bool overwrite = false;  // replace an existing output folder
  int num_threads = 0;     // 0 = all cores

  void Check() const;
};

struct CorruptedMasks {
  size_t num_masks = 0;
  size_t num_with_distractor = 0;
  std::vector<std::string> names;  // of the masks changed, below the mask folder, sorted
};

// Copies the folder of masks with labels made wrong on purpose, for the sensitivity test of the
// paper, which "mislabel[s] 10% of distractor masks [...] as static regions": in
// round(share * n) of the n masks of photos that hold a distractor all is static (255). The share
// is thus one of masks, not of pixels, and masks without a distractor, which cannot be made wrong
// this way, do not count. All other files are copies, equal in bytes; corrupted.json tells names,
// share and seed. Law: which masks are changed is a function of the names of those n, share and
// seed alone; with the same seed those of a smaller share are among those of a larger one. The
// folder appears complete or not at all; photos and masks that are read stay as they are. Throws
// Error if a photo has no mask, a mask is unreadable or not of its photo's size, the masks are a
// corrupted copy already, or the output holds or lies in a folder that is read.
CorruptedMasks CorruptMasks(const std::filesystem::path& image_path,
                            const std::filesystem::path& mask_path,
                            const std::filesystem::path& output_path,
                            const CorruptMasksOptions& options,
                            const ProgressCallback& progress = {});

}  // namespace vgtw
