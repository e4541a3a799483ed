// SPDX-License-Identifier: BSD-3-Clause
// Photos as a network's input. Internal to network/: needs LibTorch.
#pragma once

#include "network/preprocess.h"
#include "scene/distractor_mask.h"

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// The mask of a photo in its own pixels; empty = nothing of it is excluded.
using StaticMaskReader = std::function<StaticMask(const std::string& image_name)>;

// References must outlive it.
class PhotoLoader {
 public:
  // Reads the headers of all photos. Throws Error naming one that cannot be an input.
  PhotoLoader(const std::filesystem::path& image_folder,
              const std::vector<std::string>& image_names,
              const PreprocessOptions& options,
              int num_threads);

  int num_views() const { return static_cast<int>(image_names_.size()); }
  const std::string& name(int view) const { return image_names_[static_cast<size_t>(view)]; }
  const PhotoPlacement& placement(int view) const { return placements_[static_cast<size_t>(view)]; }
  int network_width() const { return placements_.front().geometry.network_width; }
  int network_height() const { return placements_.front().geometry.network_height; }

  // The views begin .. end - 1 as [n, 3, H, W] in [0, 1], on the CPU.
  at::Tensor Load(int begin, int end) const;

  // Which network pixels of those views have their centre on an excluded pixel: [n, H, W], bool.
  // Bars are not excluded. Throws Error for a mask that is not of its photo's size.
  at::Tensor LoadExcluded(int begin, int end, const StaticMaskReader& read_static_mask) const;

 private:
  const std::filesystem::path& image_folder_;
  const std::vector<std::string>& image_names_;
  PreprocessOptions options_;
  int num_threads_;
  std::vector<PhotoPlacement> placements_;
};

// Patches [S, P] of which at least half is excluded: a patch is all or nothing to attention, and
// one that a distractor only touches still says more about the static scene.
at::Tensor ExcludedPatches(const at::Tensor& excluded_pixels);

}  // namespace vgtw
