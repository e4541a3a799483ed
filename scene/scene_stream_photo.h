// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <filesystem>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// A photo as a texture without end: mirrored at its borders, and each level of the pyramid half as
// large as the one before, so that a look-up averages over about the patch it stands for.
class PhotoTexture {
 public:
  explicit PhotoTexture(const RgbImage& photo);

  // RGB in [0,1] at `position` in units of the photo's width (y down from its top edge), averaged
  // over about a square of side `footprint` (same units, > 0).
  Eigen::Vector3f ColourAt(const Eigen::Vector2f& position, float footprint) const;

 private:
  std::vector<RgbImage> levels_;
};

// The photos of a folder, at most 256, spread evenly over the sorted names.
std::vector<PhotoTexture> ReadPhotoTextures(const std::filesystem::path& folder);

}  // namespace vgtw
