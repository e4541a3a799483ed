// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import.h"
#include "scene/image_io.h"
#include "scene/view.h"

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Size of per-pixel maps.
struct MapSize {
  int width = 0;
  int height = 0;
  auto operator<=>(const MapSize&) const = default;
};

// The size of a network's input, whose principal point is its middle: twice that. For formats that
// write intrinsics and no maps. Throws Error naming `camera_idx` if the sides are not whole pixels.
MapSize MapSizeFromMiddle(const std::filesystem::path& path,
                          size_t camera_idx,
                          const Eigen::Vector2d& principal_point);

struct ResolvedResize {
  ImportResize resize = ImportResize::kAuto;
  std::vector<NetworkGeometry> geometries;  // one per photo
  std::string warning;                      // if the sizes alone do not decide, or ""
};

// The word of --resize.
std::string_view ResizeName(ImportResize resize);

// Finds how photos became the input whose maps have these sizes (one per photo). With
// `requested` = kAuto the policies are tried on the sizes:
//   crop        the width is the target, and of each map size one photo gives the very height (the
//               others were padded to it, as VGGT's loader does with a batch)
//   pad         square maps
//   square_pad  square maps
//   stretch     the aspect is kept within one patch of 14 pixels
// If those that fit give the same pixel maps, the first is taken. If they differ, crop (the loader
// of VGGT's and VGTW's demos) is taken with a warning where it fits.
// Throws Error naming --resize if none fits, or if several fit and crop does not, or if
// `requested` cannot have given these sizes.
ResolvedResize ResolveResize(const std::filesystem::path& path,
                             const std::vector<ImageSize>& photo_sizes,
                             const std::vector<MapSize>& map_sizes,
                             ImportResize requested);

}  // namespace vgtw
