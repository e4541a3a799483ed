// SPDX-License-Identifier: BSD-3-Clause
#include "network/preprocess.h"

#include "network/config.h"
#include "network/pil_resize.h"
#include "scene/error.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

constexpr Rgb kWhite = {255, 255, 255};
constexpr Rgb kBlack = {0, 0, 0};

// The size of the kStretch input: the first photo's aspect in whole patches, as large as
// `max_pixels` allows.
NetworkGeometry StretchGeometry(const ImageSize& first_photo, int64_t max_pixels) {
  const auto width = static_cast<double>(first_photo.width);
  const auto height = static_cast<double>(first_photo.height);
  const double scale = std::sqrt(static_cast<double>(max_pixels) / (width * height));
  const double ideal_width = width * scale;
  const double ideal_height = height * scale;
  // nearbyint rounds halves to the even neighbour, as Python does.
  auto num_columns = static_cast<int64_t>(std::nearbyint(ideal_width / kPatchSize));
  auto num_rows = static_cast<int64_t>(std::nearbyint(ideal_height / kPatchSize));
  while (num_columns * num_rows * kPatchSize * kPatchSize > max_pixels) {
    const double aspect = static_cast<double>(num_columns) / static_cast<double>(num_rows);
    --(aspect > ideal_width / ideal_height ? num_columns : num_rows);
  }
  return {static_cast<int>(num_columns * kPatchSize), static_cast<int>(num_rows * kPatchSize)};
}

std::vector<NetworkGeometry> GeometriesOf(const std::vector<ImageSize>& photo_sizes,
                                          const PreprocessOptions& options) {
  NetworkGeometry canvas = {options.side_px, 0};
  if (options.policy == ResizePolicy::kStretch) {
    canvas = StretchGeometry(photo_sizes.front(), options.max_pixels);
  }
  std::vector<NetworkGeometry> geometries;
  for (const ImageSize& size : photo_sizes) {
    geometries.push_back(MakeNetworkGeometry(
        options.policy, size.width, size.height, canvas.network_width, canvas.network_height));
  }
  for (const NetworkGeometry& geometry : geometries) {
    canvas.network_width = std::max(canvas.network_width, geometry.network_width);
    canvas.network_height = std::max(canvas.network_height, geometry.network_height);
  }
  for (NetworkGeometry& geometry : geometries) {
    geometry = PadGeometry(geometry, canvas.network_width, canvas.network_height);
  }
  return geometries;
}

PhotoPlacement PlacementOf(const ImageSize& size, const NetworkGeometry& geometry) {
  const PixelMap network_from_original = Inverse(geometry.original_from_network);
  const Eigen::Vector2d begin = Apply(network_from_original, Eigen::Vector2d::Zero());
  const Eigen::Vector2d end =
      Apply(network_from_original, Eigen::Vector2d(size.width, size.height));
  // The first index whose centre is not before `border`.
  const auto first_centre = [](double border, int num_pixels) {
    return static_cast<int>(std::clamp(std::ceil(border - 0.5), 0.0, num_pixels * 1.0));
  };
  return {size,
          geometry,
          first_centre(begin.x(), geometry.network_width),
          first_centre(end.x(), geometry.network_width),
          first_centre(begin.y(), geometry.network_height),
          first_centre(end.y(), geometry.network_height)};
}

// `photo` in the middle of a square.
RgbImage PadToSquare(const RgbImage& photo) {
  const int side = std::max(photo.width(), photo.height());
  const int left = (side - photo.width()) / 2;
  const int top = (side - photo.height()) / 2;
  RgbImage square(side, side, kBlack);
  for (int y = 0; y < photo.height(); ++y) {
    std::copy_n(&photo(0, y), photo.width(), &square(left, top + y));
  }
  return square;
}

// How a loader that resizes first fills the input.
struct ResizedPhoto {
  int width = 0;
  int height = 0;
  int first_row = 0;  // that is kept
  int num_rows = 0;
};

ResizedPhoto ResizedPhotoOf(const PhotoPlacement& placement) {
  const PixelMap& original_from_network = placement.geometry.original_from_network;
  const auto in_network = [](double original, double scale) {
    return static_cast<int>(std::lround(original / scale));
  };
  const double scale_y = original_from_network(1, 1);
  return {in_network(static_cast<double>(placement.photo_size.width), original_from_network(0, 0)),
          in_network(static_cast<double>(placement.photo_size.height), scale_y),
          std::max(0, in_network(original_from_network(1, 2), scale_y)),
          placement.end_row - placement.first_row};
}

// The resized photo is drawn where the map says.
RgbImage DrawResized(const RgbImage& photo,
                     const PhotoPlacement& placement,
                     PilResizeOptions options) {
  const ResizedPhoto resized = ResizedPhotoOf(placement);
  options.first_row = resized.first_row;
  options.num_rows = resized.num_rows;
  const RgbImage rows = PilResize(photo, resized.width, resized.height, options);
  RgbImage canvas(placement.geometry.network_width, placement.geometry.network_height, kWhite);
  for (int y = 0; y < rows.height(); ++y) {
    std::copy_n(
        &rows(0, y), rows.width(), &canvas(placement.first_column, placement.first_row + y));
  }
  return canvas;
}

// The pixel that is taken for each of `new_size` pixels. Added up as Pillow does, whose rounding
// decides where a centre falls on the edge between two pixels.
std::vector<int> NearestNeighbours(int old_size, int new_size) {
  const double step = static_cast<double>(old_size) / new_size;
  std::vector<int> neighbours;
  for (double position = 0.5 * step; neighbours.size() < static_cast<size_t>(new_size);
       position += step) {
    neighbours.push_back(std::min(static_cast<int>(position), old_size - 1));
  }
  return neighbours;
}

}  // namespace

void PreprocessOptions::Check() const {
  const bool in_patches = policy == ResizePolicy::kCrop || policy == ResizePolicy::kPad;
  VGTW_CHECK(side_px > 0 && side_px <= 1 << 14,
             "PreprocessOptions::side_px = " + std::to_string(side_px));
  VGTW_CHECK(!in_patches || side_px % kPatchSize == 0,
             "PreprocessOptions::side_px = " + std::to_string(side_px));
  VGTW_CHECK(max_pixels >= kPatchSize * kPatchSize && max_pixels <= 1 << 28,
             "PreprocessOptions::max_pixels = " + std::to_string(max_pixels));
}

std::string FindFault(const ImageSize& photo_size, const PreprocessOptions& options) {
  const auto shorter = static_cast<double>(std::min(photo_size.width, photo_size.height));
  const auto longer = static_cast<double>(std::max(photo_size.width, photo_size.height));
  const double side = options.policy == ResizePolicy::kStretch
                          ? std::sqrt(static_cast<double>(options.max_pixels))
                          : options.side_px;
  if (shorter > 0.0 && shorter * side >= longer * static_cast<double>(kPatchSize)) return "";
  return std::to_string(photo_size.width) + "x" + std::to_string(photo_size.height) +
         " pixels, of which the network would see less than " + std::to_string(kPatchSize) +
         " rows or columns";
}

std::vector<PhotoPlacement> PlacePhotos(const std::vector<ImageSize>& photo_sizes,
                                        const PreprocessOptions& options) {
  options.Check();
  VGTW_CHECK(!photo_sizes.empty(), "no photos");
  for (const ImageSize& size : photo_sizes) {
    const std::string fault = FindFault(size, options);
    VGTW_CHECK(fault.empty(), "a photo has " + fault);
  }
  const std::vector<NetworkGeometry> geometries = GeometriesOf(photo_sizes, options);
  std::vector<PhotoPlacement> placements;
  for (size_t i = 0; i < photo_sizes.size(); ++i) {
    placements.push_back(PlacementOf(photo_sizes[i], geometries[i]));
  }
  return placements;
}

RgbImage MakeNetworkImage(const RgbImage& photo,
                          const PhotoPlacement& placement,
                          const PreprocessOptions& options,
                          int num_threads) {
  const ImageSize photo_size = {static_cast<uint64_t>(photo.width()),
                                static_cast<uint64_t>(photo.height())};
  VGTW_CHECK(photo_size == placement.photo_size, "the photo has another size than was placed");
  PilResizeOptions resize = {.num_threads = num_threads};
  if (options.policy == ResizePolicy::kSquarePad) {
    return PilResize(PadToSquare(photo),
                     placement.geometry.network_width,
                     placement.geometry.network_height,
                     resize);
  }
  if (options.policy == ResizePolicy::kStretch) resize.filter = PilFilter::kLanczos;
  return DrawResized(photo, placement, resize);
}

StaticMask MakeNetworkMask(const StaticMask& photo_mask,
                           const PhotoPlacement& placement,
                           const PreprocessOptions& options,
                           uint8_t outside) {
  VGTW_CHECK(options.policy != ResizePolicy::kSquarePad, "no mask for kSquarePad");
  VGTW_CHECK(photo_mask.width() == static_cast<int>(placement.photo_size.width) &&
                 photo_mask.height() == static_cast<int>(placement.photo_size.height),
             "mask is not of its photo's size");
  const ResizedPhoto resized = ResizedPhotoOf(placement);
  const std::vector<int> columns = NearestNeighbours(photo_mask.width(), resized.width);
  const std::vector<int> rows = NearestNeighbours(photo_mask.height(), resized.height);
  const NetworkGeometry& geometry = placement.geometry;
  StaticMask mask(geometry.network_width, geometry.network_height, outside);
  for (int y = 0; y < resized.num_rows; ++y) {
    const int photo_y = rows[static_cast<size_t>(resized.first_row + y)];
    for (int x = 0; x < resized.width; ++x) {
      mask(placement.first_column + x, placement.first_row + y) =
          photo_mask(columns[static_cast<size_t>(x)], photo_y);
    }
  }
  return mask;
}

}  // namespace vgtw
