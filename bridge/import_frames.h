// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import_geometry.h"
#include "scene/depth_map.h"
#include "scene/distractor_mask.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// Files of one kind, one a frame, numbered from 0: <folder>/<prefix><number><extension>, the number
// with leading zeros up to `num_digits`.
struct FrameFiles {
  std::filesystem::path folder;
  std::string prefix;
  int num_digits = 1;
  std::string extension;

  std::filesystem::path Path(size_t frame) const;

  // Whether the frames have them. Throws Error naming the first that is missing where some have.
  bool HaveAll(size_t num_frames) const;
};

// Sizes of the maps of these .npy files. Throws Error if one is missing, damaged or no map.
std::vector<MapSize> FrameSizes(const FrameFiles& files, size_t num_frames);

// One map of an .npy file. Throws Error if it is damaged or of another size.
Grid<float> ReadFrameMap(const std::filesystem::path& path, const MapSize& size);

// A gray image as probabilities in steps of 1/255 (255 = distractor). Throws Error as ReadFrameMap.
DistractorMask ReadFrameMask(const std::filesystem::path& path, const MapSize& size);

}  // namespace vgtw
