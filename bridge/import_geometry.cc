// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_geometry.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

namespace vgtw {
namespace {

constexpr int kPatchSize = 14;

struct PolicyRow {
  ImportResize resize;
  ResizePolicy policy;
  std::string_view name;
};
constexpr std::array<PolicyRow, 4> kPolicies = {
    {{ImportResize::kCrop, ResizePolicy::kCrop, "crop"},
     {ImportResize::kPad, ResizePolicy::kPad, "pad"},
     {ImportResize::kSquarePad, ResizePolicy::kSquarePad, "square_pad"},
     {ImportResize::kStretch, ResizePolicy::kStretch, "stretch"}}};

const PolicyRow& RowOf(ImportResize resize) {
  return *std::find_if(kPolicies.begin(), kPolicies.end(), [&](const PolicyRow& row) {
    return row.resize == resize;
  });
}

std::string SizeText(uint64_t width, uint64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

// The loaders round the shorter side to whole patches; less than half a patch is no image.
bool HasPatches(const ImageSize& photo, int target) {
  const auto shorter = static_cast<double>(std::min(photo.width, photo.height));
  const auto longer = static_cast<double>(std::max(photo.width, photo.height));
  return shorter * target / longer > 0.5 * kPatchSize && longer / shorter < 1e4;
}

bool KeepsAspect(const ImageSize& photo, const MapSize& map) {
  const double scale_x = map.width / static_cast<double>(photo.width);
  const double scale_y = map.height / static_cast<double>(photo.height);
  return std::abs(scale_x * static_cast<double>(photo.height) - map.height) <= kPatchSize ||
         std::abs(scale_y * static_cast<double>(photo.width) - map.width) <= kPatchSize;
}

std::optional<NetworkGeometry> GeometryOf(ResizePolicy policy,
                                          const ImageSize& photo,
                                          const MapSize& map) {
  if (policy == ResizePolicy::kStretch) {
    return MakeNetworkGeometry(policy, photo.width, photo.height, map.width, map.height);
  }
  if (policy != ResizePolicy::kCrop && map.width != map.height) return std::nullopt;
  if (!HasPatches(photo, map.width)) return std::nullopt;
  const NetworkGeometry geometry =
      MakeNetworkGeometry(policy, photo.width, photo.height, map.width, map.height);
  if (geometry.network_width > map.width || geometry.network_height > map.height) {
    return std::nullopt;
  }
  return geometry;
}

// Geometries of all photos, or nullopt if the policy cannot have given these sizes.
std::optional<std::vector<NetworkGeometry>> TryPolicy(ResizePolicy policy,
                                                      const std::vector<ImageSize>& photos,
                                                      const std::vector<MapSize>& maps) {
  std::vector<NetworkGeometry> geometries;
  std::map<MapSize, bool> is_filled;
  for (size_t i = 0; i < photos.size(); ++i) {
    const std::optional<NetworkGeometry> geometry = GeometryOf(policy, photos[i], maps[i]);
    if (!geometry) return std::nullopt;
    is_filled[maps[i]] |=
        geometry->network_width == maps[i].width && geometry->network_height == maps[i].height;
    geometries.push_back(PadGeometry(*geometry, maps[i].width, maps[i].height));
  }
  const bool all_filled = std::all_of(
      is_filled.begin(), is_filled.end(), [](const auto& entry) { return entry.second; });
  if (!all_filled) return std::nullopt;
  return geometries;
}

bool SameMaps(const std::vector<NetworkGeometry>& a, const std::vector<NetworkGeometry>& b) {
  return std::equal(
      a.begin(), a.end(), b.begin(), b.end(), [](const auto& left, const auto& right) {
        return left.original_from_network.isApprox(right.original_from_network, 1e-9);
      });
}

std::vector<ResolvedResize> FittingPolicies(const std::vector<ImageSize>& photos,
                                            const std::vector<MapSize>& maps) {
  std::vector<ResolvedResize> fitting;
  for (const PolicyRow& row : kPolicies) {
    if (row.policy == ResizePolicy::kStretch &&
        !std::equal(photos.begin(), photos.end(), maps.begin(), KeepsAspect)) {
      continue;
    }
    if (auto geometries = TryPolicy(row.policy, photos, maps)) {
      fitting.push_back({row.resize, *std::move(geometries), ""});
    }
  }
  return fitting;
}

std::string NamesOf(const std::vector<ResolvedResize>& candidates) {
  std::string names;
  for (const ResolvedResize& candidate : candidates) {
    names += (names.empty() ? "" : ", ") + std::string(ResizeName(candidate.resize));
  }
  return names;
}

}  // namespace

std::string_view ResizeName(ImportResize resize) {
  return resize == ImportResize::kAuto ? "auto" : RowOf(resize).name;
}

MapSize MapSizeFromMiddle(const std::filesystem::path& path,
                          size_t camera_idx,
                          const Eigen::Vector2d& principal_point) {
  constexpr double kMaxRounding = 1e-3;
  constexpr double kMaxSide = 1 << 15;
  const Eigen::Vector2d sides = 2.0 * principal_point;
  const auto is_size = [](double side) {
    return side >= 2.0 && side <= kMaxSide && std::abs(side - std::round(side)) < kMaxRounding;
  };
  if (!is_size(sides.x()) || !is_size(sides.y())) {
    Fail(path,
         "the principal point of camera " + std::to_string(camera_idx) + " is (" +
             std::to_string(principal_point.x()) + ", " + std::to_string(principal_point.y()) + ")",
         "the middle of the network's input, which tells its size",
         "give the intrinsics in original pixels by --camera_params");
  }
  return {static_cast<int>(std::lround(sides.x())), static_cast<int>(std::lround(sides.y()))};
}

ResolvedResize ResolveResize(const std::filesystem::path& path,
                             const std::vector<ImageSize>& photo_sizes,
                             const std::vector<MapSize>& map_sizes,
                             ImportResize requested) {
  VGTW_CHECK(!photo_sizes.empty() && photo_sizes.size() == map_sizes.size(), "one map per photo");
  const std::string found = "maps of " +
                            SizeText(static_cast<uint64_t>(map_sizes[0].width),
                                     static_cast<uint64_t>(map_sizes[0].height)) +
                            " for photos of " +
                            SizeText(photo_sizes[0].width, photo_sizes[0].height);
  if (requested != ImportResize::kAuto) {
    auto geometries = TryPolicy(RowOf(requested).policy, photo_sizes, map_sizes);
    if (!geometries) {
      Fail(path,
           found,
           "sizes that --resize " + std::string(ResizeName(requested)) + " can give",
           "try --resize auto");
    }
    return {requested, *std::move(geometries), ""};
  }
  std::vector<ResolvedResize> fitting = FittingPolicies(photo_sizes, map_sizes);
  if (fitting.empty()) {
    Fail(path,
         found,
         "the sizes that a known loader gives",
         "if the photos were resized without keeping their aspect, add --resize stretch; if they "
         "are not the ones that the network saw, name those by --image_path");
  }
  const bool agree = std::all_of(fitting.begin(), fitting.end(), [&](const ResolvedResize& other) {
    return SameMaps(fitting.front().geometries, other.geometries);
  });
  if (!agree && fitting.front().resize != ImportResize::kCrop) {
    Fail(path,
         found + ", which " + NamesOf(fitting) + " can give",
         "one way to resize",
         "say it by --resize");
  }
  const std::string names = NamesOf(fitting);
  ResolvedResize resolved = std::move(fitting.front());
  if (!agree) {
    resolved.warning = found + " can come from " + names +
                       ": taken as crop (the loader of VGGT's and VGTW's demos); say another by "
                       "--resize";
  }
  return resolved;
}

}  // namespace vgtw
