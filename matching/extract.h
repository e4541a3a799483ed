// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "matching/sift.h"
#include "scene/distractor_mask.h"
#include "scene/features.h"
#include "scene/image_io.h"
#include "scene/progress.h"

#include <cstddef>
#include <cstdint>
#include <functional>

namespace vgtw {

struct MaskedPhoto {
  GrayImage image;
  StaticMask static_mask;  // of the image's size; empty = nothing is excluded
};

// Called by several threads at a time.
using PhotoLoader = std::function<MaskedPhoto(size_t photo_idx)>;
// Called by one thread at a time, with 0, 1, 2, ...
using FeatureSink = std::function<void(size_t photo_idx, Features features)>;

struct ExtractOptions {
  SiftOptions sift;
  // Photos at a time, one thread each; 0 or less = all cores.
  int num_threads = 0;
  // No photo is begun where it and those under way would take more than this many bytes
  // (SiftMemory) together, unless it is the only one; 0 = half of the memory that is available,
  // >= 0.
  int64_t max_memory = 0;

  void Check() const;
};

// ExtractSift of photos 0 .. num_photos - 1. OpenCV's own threads are off, for the whole process,
// until it returns. The first exception of `load` or `sink` ends it and is thrown; `sink` then has
// got all photos before some index and none after.
void ExtractAll(size_t num_photos,
                const PhotoLoader& load,
                const FeatureSink& sink,
                const ExtractOptions& options,
                const ProgressCallback& progress = {});

}  // namespace vgtw
