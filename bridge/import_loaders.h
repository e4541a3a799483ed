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

// The size of the maps that this loader gives a photo at its default size, 512.
MapSize DefaultDust3rMapSize(const ImageSize& photo_size);

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

// MapAnything's loader: the photo is scaled until it covers the map (both sides rounded down), and
// what overhangs is cut off on both sides alike. nullopt if that takes more than half of the photo.
// Source: facebookresearch/map-anything: mapanything/utils/{image,cropping}.py.
std::optional<NetworkGeometry> MapAnythingGeometry(const ImageSize& photo_size,
                                                   const MapSize& map_size);

// The same for all photos. Throws Error as ResolveDust3r does.
std::vector<NetworkGeometry> ResolveMapAnything(const std::filesystem::path& path,
                                                const std::filesystem::path& image_folder,
                                                const std::vector<Photo>& photos,
                                                const MapSize& map_size);

// pi3's loader: all photos are stretched to one size, which the first of them gives: its aspect in
// whole patches of 14, at most 255000 pixels unless asked otherwise. EXIF orientations are not
// applied. Throws Error if the first photo has another aspect than the maps.
// Source: yyfz/Pi3: pi3/utils/basic.py (load_images_as_tensor).
std::vector<NetworkGeometry> ResolvePi3(const std::filesystem::path& path,
                                        const std::vector<Photo>& photos,
                                        const MapSize& map_size);

}  // namespace vgtw
