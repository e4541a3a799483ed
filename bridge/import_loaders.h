// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import_geometry.h"
#include "bridge/import_photos.h"
#include "scene/image_io.h"
#include "scene/view.h"

#include <filesystem>
#include <optional>
#include <vector>

namespace vgtw {

// What loaders other than those of scene/view.h's ResizePolicy make of photos. All resize the whole
// photo, corner to corner, so that a resize is a pure scale of continuous pixels.

// DUSt3R's loader, taken over by MASt3R, MonST3R, Easi3R and CUT3R: the longest side to the map's
// longest (512), rounded half to even; then whole patches of 16 pixels from the centre W / 2,
// rounded down; of a square 3 / 4 of the height, or all of it (square_ok). Maps of 224x224: the
// shortest side to 224, then the centre. nullopt if a map of this size cannot come from that.
// Source: naver/dust3r, Junyi42/monst3r, CUT3R/CUT3R: dust3r/utils/image.py (load_images).
std::optional<NetworkGeometry> Dust3rGeometry(const ImageSize& photo_size, const MapSize& map_size);

// Those of the photos, one each. Resolves --resize: auto and crop mean the loader, stretch a run
// without crop. Throws Error if the sizes do not fit, or if a photo has an EXIF orientation: that
// loader applies it, and maps would lie across the stored pixels.
std::vector<NetworkGeometry> ResolveDust3r(const std::filesystem::path& path,
                                           const std::filesystem::path& image_folder,
                                           const std::vector<Photo>& photos,
                                           const std::vector<MapSize>& map_sizes,
                                           ImportResize requested);

// Depth Anything 3's loader (upper_bound_resize): the longest side to `process_res` (504), both
// sides rounded to the nearest multiple of 14 by stretching, halves upwards; photos that came out
// larger than the smallest width and height are cut to these around the centre. Of photos of one
// size the map's size says all; of several sizes 504 is tried first, then every other process_res.
// nullopt if none gives this map size, or several do that differ.
// Source: ByteDance-Seed/Depth-Anything-3: src/depth_anything_3/utils/io/input_processor.py.
std::optional<std::vector<NetworkGeometry>> DepthAnything3Geometries(
    const std::vector<ImageSize>& photo_sizes, const MapSize& map_size);

}  // namespace vgtw
