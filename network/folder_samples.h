// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/train.h"
#include "network/training_sample.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

struct FolderSampleOptions {
  std::vector<MaskedFolder> folders;  // one scene each
  int width = 518;                    // of what the network sees; multiples of the patch size
  int height = 392;
  int min_views = 2;
  int max_views = 10;
  uint64_t seed = 0;
};

// Photos with masks, from one folder at a time, in random order: cropped (at least 0.8 of the
// largest window of the wanted shape), and with one change of brightness, contrast and saturation
// (each by at most 0.3) for all views. No geometry.
class FolderSamples : public SampleSource {
 public:
  // Throws Error if a folder has less than two photos, or a photo no mask of its size.
  explicit FolderSamples(const FolderSampleOptions& options);
  TrainingSample Get(uint64_t idx) const override;

 private:
  struct Scene {
    MaskedFolder folder;
    std::vector<std::string> names;
  };
  FolderSampleOptions options_;
  std::vector<Scene> scenes_;
};

}  // namespace vgtw
