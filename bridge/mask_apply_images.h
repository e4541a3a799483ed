// SPDX-License-Identifier: BSD-3-Clause
// Which keypoints of a database are on distractors.
#pragma once

#include "bridge/mask_apply.h"
#include "scene/reconstruction.h"

#include <cstdint>
#include <filesystem>
#include <unordered_map>
#include <utility>
#include <vector>

namespace vgtw {

class SqliteConnection;

// Counts the units of work of all stages together.
class ProgressCounter {
 public:
  ProgressCounter(ProgressCallback callback, int64_t total)
      : callback_(std::move(callback)), total_(total) {}
  void Advance(int64_t units) {
    done_ += units;
    if (callback_) callback_(done_, total_);
  }

 private:
  ProgressCallback callback_;
  int64_t total_ = 0;
  int64_t done_ = 0;
};

// One image of the database with what its mask says.
struct MaskedImage {
  ImageId image_id = 0;
  uint64_t width = 0;
  uint64_t height = 0;
  std::vector<bool> is_excluded;  // per keypoint
  bool had_geometry = false;      // with inlier matches, before and after FilterPairs
  bool has_geometry = false;
  ApplyMasksImageSummary summary;
};

using MaskedImagesById = std::unordered_map<ImageId, const MaskedImage*>;
MaskedImagesById ById(const std::vector<MaskedImage>& images);

// All images, sorted by name; nothing is excluded if `mask_folder` is "". Masks are decoded in
// parallel, a batch at a time to bound the memory. Advances by one per image.
std::vector<MaskedImage> MaskImages(SqliteConnection& connection,
                                    const std::filesystem::path& mask_folder,
                                    const ApplyMasksOptions& options,
                                    ProgressCounter& progress);

inline constexpr uint32_t kRemovedIdx = 0xffffffff;

// The index of each keypoint once the excluded ones are gone; kRemovedIdx for these.
std::vector<uint32_t> RenumberedIndices(const std::vector<bool>& is_excluded);

}  // namespace vgtw
