// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_loaders.h"

#include "scene/error.h"
#include "scene/exif_orientation.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

namespace vgtw {
namespace {

// A photo after its resize, before crops.
struct Resized {
  int64_t width = 0;
  int64_t height = 0;
  bool operator==(const Resized&) const = default;
};

// Python's round(): nearbyint is half to even.
Resized ScaleLongestSide(const ImageSize& photo, double target) {
  const auto longest = static_cast<double>(std::max(photo.width, photo.height));
  const auto scale = [&](uint64_t side) {
    return static_cast<int64_t>(std::nearbyint(static_cast<double>(side) * target / longest));
  };
  return {scale(photo.width), scale(photo.height)};
}

// The part of `size` from (left, top) on of the resized photo.
NetworkGeometry CropOf(const ImageSize& photo,
                       const Resized& resized,
                       int64_t left,
                       int64_t top,
                       const MapSize& size) {
  const double scale_x = static_cast<double>(photo.width) / static_cast<double>(resized.width);
  const double scale_y = static_cast<double>(photo.height) / static_cast<double>(resized.height);
  NetworkGeometry geometry;
  geometry.network_width = size.width;
  geometry.network_height = size.height;
  geometry.original_from_network << scale_x, 0.0, scale_x * static_cast<double>(left),  //
      0.0, scale_y, scale_y * static_cast<double>(top);
  return geometry;
}

std::string SizesText(const MapSize& map, const Photo& photo) {
  return "maps of " + std::to_string(map.width) + "x" + std::to_string(map.height) + " for " +
         Printable(photo.name) + " of " + std::to_string(photo.size.width) + "x" +
         std::to_string(photo.size.height);
}

void CheckOrientation(const std::filesystem::path& photo_path) {
  const int orientation = ReadExifOrientation(photo_path);
  if (orientation == 1) return;
  Fail(photo_path,
       "has EXIF orientation " + std::to_string(orientation) +
           ", which the network's loader applied",
       "photos whose pixels are stored upright",
       "turn the pixels of copies and name those by --image_path");
}

constexpr int kDepthAnythingPatch = 14;

int64_t NearestPatches(int64_t side) {
  const int64_t down = side / kDepthAnythingPatch * kDepthAnythingPatch;
  const int64_t up = down + kDepthAnythingPatch;
  return std::max<int64_t>(1, up - side <= side - down ? up : down);
}

// What upper_bound_resize makes of the photos.
std::vector<Resized> ProcessAll(const std::vector<ImageSize>& photo_sizes, int process_res) {
  std::vector<Resized> all;
  for (const ImageSize& photo : photo_sizes) {
    const Resized scaled = ScaleLongestSide(photo, process_res);
    all.push_back({NearestPatches(std::max<int64_t>(1, scaled.width)),
                   NearestPatches(std::max<int64_t>(1, scaled.height))});
  }
  return all;
}

bool IsSmallest(const std::vector<Resized>& all, const MapSize& map_size) {
  int64_t width = all.front().width;
  int64_t height = all.front().height;
  for (const Resized& resized : all) {
    width = std::min(width, resized.width);
    height = std::min(height, resized.height);
  }
  return width == map_size.width && height == map_size.height;
}

// The sizes after the resize that lead to this map size; see the header.
std::optional<std::vector<Resized>> FindProcessed(const std::vector<ImageSize>& photo_sizes,
                                                  const MapSize& map_size) {
  constexpr int kDefaultProcessRes = 504;
  constexpr int kMaxProcessRes = 1 << 13;
  std::vector<Resized> by_default = ProcessAll(photo_sizes, kDefaultProcessRes);
  if (IsSmallest(by_default, map_size)) return by_default;
  std::optional<std::vector<Resized>> found;
  for (int process_res = kDepthAnythingPatch; process_res <= kMaxProcessRes; ++process_res) {
    std::vector<Resized> all = ProcessAll(photo_sizes, process_res);
    if (!IsSmallest(all, map_size)) continue;
    if (found && *found != all) return std::nullopt;
    found = std::move(all);
  }
  return found;
}

}  // namespace

std::optional<NetworkGeometry> Dust3rGeometry(const ImageSize& photo_size,
                                              const MapSize& map_size) {
  constexpr int kPatch = 16;
  constexpr MapSize kSquare = {224, 224};
  const auto shortest = static_cast<double>(std::min(photo_size.width, photo_size.height));
  const auto longest = static_cast<double>(std::max(photo_size.width, photo_size.height));
  const bool is_square_crop = map_size == kSquare;
  const double target = is_square_crop ? std::nearbyint(kSquare.width * (longest / shortest))
                                       : std::max(map_size.width, map_size.height);
  const Resized resized = ScaleLongestSide(photo_size, target);
  const int64_t centre_x = resized.width / 2;
  const int64_t centre_y = resized.height / 2;
  int64_t half_width = 2 * centre_x / kPatch * (kPatch / 2);
  int64_t half_height = 2 * centre_y / kPatch * (kPatch / 2);
  if (is_square_crop) {
    half_width = half_height = std::min(centre_x, centre_y);
  } else if (resized.width == resized.height && map_size.width != map_size.height) {
    half_height = 3 * half_width / 4;
  }
  if (2 * half_width != map_size.width || 2 * half_height != map_size.height) return std::nullopt;
  return CropOf(photo_size, resized, centre_x - half_width, centre_y - half_height, map_size);
}

MapSize DefaultDust3rMapSize(const ImageSize& photo_size) {
  constexpr int kDefaultSize = 512;
  constexpr int kPatch = 16;
  const Resized resized = ScaleLongestSide(photo_size, kDefaultSize);
  const auto patches = [](int64_t side) { return static_cast<int>(side / kPatch * kPatch); };
  const bool is_square = resized.width == resized.height;
  return {patches(resized.width), is_square ? kDefaultSize * 3 / 4 : patches(resized.height)};
}

std::vector<NetworkGeometry> ResolveDust3r(const std::filesystem::path& path,
                                           const std::filesystem::path& image_folder,
                                           const std::vector<Photo>& photos,
                                           const std::vector<MapSize>& map_sizes,
                                           ImportResize requested) {
  VGTW_CHECK(photos.size() == map_sizes.size(), "one map per photo");
  if (requested == ImportResize::kPad || requested == ImportResize::kSquarePad) {
    Fail(path,
         "comes from DUSt3R's loader, which never pads",
         "--resize crop or stretch",
         "leave --resize out");
  }
  std::vector<NetworkGeometry> geometries;
  for (size_t i = 0; i < photos.size(); ++i) {
    CheckOrientation(image_folder / photos[i].name);
    const std::optional<NetworkGeometry> geometry =
        requested == ImportResize::kStretch ? MakeNetworkGeometry(ResizePolicy::kStretch,
                                                                  photos[i].size.width,
                                                                  photos[i].size.height,
                                                                  map_sizes[i].width,
                                                                  map_sizes[i].height)
                                            : Dust3rGeometry(photos[i].size, map_sizes[i]);
    if (!geometry) {
      Fail(path,
           SizesText(map_sizes[i], photos[i]),
           "the size that DUSt3R's loader gives",
           "name the photos that the network saw by --image_path, or say --resize stretch if it "
           "ran without crop");
    }
    geometries.push_back(*geometry);
  }
  return geometries;
}

std::optional<std::vector<NetworkGeometry>> DepthAnything3Geometries(
    const std::vector<ImageSize>& photo_sizes, const MapSize& map_size) {
  VGTW_CHECK(!photo_sizes.empty(), "photos");
  // Photos of a batch have few sizes; the search need not look at each photo.
  std::vector<ImageSize> distinct;
  for (const ImageSize& size : photo_sizes) {
    if (std::find(distinct.begin(), distinct.end(), size) == distinct.end()) {
      distinct.push_back(size);
    }
  }
  const std::optional<std::vector<Resized>> processed = FindProcessed(distinct, map_size);
  if (!processed) return std::nullopt;
  std::vector<NetworkGeometry> geometries;
  for (const ImageSize& size : photo_sizes) {
    const auto idx = std::find(distinct.begin(), distinct.end(), size) - distinct.begin();
    const Resized& resized = (*processed)[static_cast<size_t>(idx)];
    geometries.push_back(CropOf(size,
                                resized,
                                (resized.width - map_size.width) / 2,
                                (resized.height - map_size.height) / 2,
                                map_size));
  }
  return geometries;
}

std::optional<NetworkGeometry> MapAnythingGeometry(const ImageSize& photo_size,
                                                   const MapSize& map_size) {
  constexpr double kCover = 1e-8;  // the loader adds it so that rounding down still covers the map
  const auto width = static_cast<double>(photo_size.width);
  const auto height = static_cast<double>(photo_size.height);
  const double scale = std::max(map_size.width / width, map_size.height / height) + kCover;
  const Resized resized = {static_cast<int64_t>(width * scale),
                           static_cast<int64_t>(height * scale)};
  const bool fits = resized.width >= map_size.width && resized.height >= map_size.height &&
                    resized.width <= 2 * int64_t{map_size.width} &&
                    resized.height <= 2 * int64_t{map_size.height};
  if (!fits) return std::nullopt;
  return CropOf(photo_size,
                resized,
                (resized.width - map_size.width) / 2,
                (resized.height - map_size.height) / 2,
                map_size);
}

std::vector<NetworkGeometry> ResolveMapAnything(const std::filesystem::path& path,
                                                const std::filesystem::path& image_folder,
                                                const std::vector<Photo>& photos,
                                                const MapSize& map_size) {
  std::vector<NetworkGeometry> geometries;
  for (const Photo& photo : photos) {
    CheckOrientation(image_folder / photo.name);
    const std::optional<NetworkGeometry> geometry = MapAnythingGeometry(photo.size, map_size);
    if (!geometry) {
      Fail(path,
           SizesText(map_size, photo),
           "the centre that MapAnything's loader cuts out",
           "name the photos that the network saw by --image_path");
    }
    geometries.push_back(*geometry);
  }
  return geometries;
}

std::vector<NetworkGeometry> ResolvePi3(const std::filesystem::path& path,
                                        const std::vector<Photo>& photos,
                                        const MapSize& map_size) {
  // Rounding to patches, and another patch to stay below the limit.
  constexpr double kMaxDeviation = 1.5 * 14;
  const ImageSize& first = photos.front().size;
  const double scale =
      std::sqrt(static_cast<double>(map_size.width) * map_size.height /
                (static_cast<double>(first.width) * static_cast<double>(first.height)));
  const auto deviates = [&](uint64_t photo_side, int map_side) {
    return std::abs(scale * static_cast<double>(photo_side) - map_side) > kMaxDeviation;
  };
  if (deviates(first.width, map_size.width) || deviates(first.height, map_size.height)) {
    Fail(path,
         SizesText(map_size, photos.front()),
         "the aspect of the first photo, as pi3's loader gives it",
         "name the photos that the network saw by --image_path");
  }
  std::vector<NetworkGeometry> geometries;
  for (const Photo& photo : photos) {
    geometries.push_back(MakeNetworkGeometry(ResizePolicy::kStretch,
                                             photo.size.width,
                                             photo.size.height,
                                             map_size.width,
                                             map_size.height));
  }
  return geometries;
}

}  // namespace vgtw
