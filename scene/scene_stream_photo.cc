// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_photo.h"

#include "scene/parallel.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

namespace vgtw {
namespace {

// Enough for the largest face of a picture of 518 pixels.
constexpr int kMaxSide = 512;

RgbImage Halve(const RgbImage& image) {
  const int max_x = image.width() - 1;
  const int max_y = image.height() - 1;
  RgbImage half(std::max(1, image.width() / 2), std::max(1, image.height() / 2));
  for (int y = 0; y < half.height(); ++y) {
    for (int x = 0; x < half.width(); ++x) {
      const int x1 = std::min(2 * x + 1, max_x);
      const int y1 = std::min(2 * y + 1, max_y);
      for (size_t c = 0; c < 3; ++c) {
        const int sum = image(std::min(2 * x, max_x), std::min(2 * y, max_y))[c] +
                        image(x1, std::min(2 * y, max_y))[c] +
                        image(std::min(2 * x, max_x), y1)[c] + image(x1, y1)[c];
        half(x, y)[c] = static_cast<uint8_t>((sum + 2) / 4);
      }
    }
  }
  return half;
}

// Pixel index in [0, size) of an index without bounds, mirrored at the borders.
int Mirror(int index, int size) {
  const int period = 2 * size;
  const int folded = ((index % period) + period) % period;
  return folded < size ? folded : period - 1 - folded;
}

Eigen::Vector3f ToColour(const Rgb& rgb) {
  return Eigen::Vector3f(rgb[0], rgb[1], rgb[2]) / 255.0f;
}

}  // namespace

PhotoTexture::PhotoTexture(const RgbImage& photo) {
  levels_.push_back(photo);
  while (std::max(levels_.back().width(), levels_.back().height()) > kMaxSide) {
    levels_.back() = Halve(levels_.back());
  }
  while (std::min(levels_.back().width(), levels_.back().height()) > 1) {
    levels_.push_back(Halve(levels_.back()));
  }
}

Eigen::Vector3f PhotoTexture::ColourAt(const Eigen::Vector2f& position, float footprint) const {
  const float footprint_px = footprint * static_cast<float>(levels_[0].width());
  const int level_idx = std::clamp(std::ilogb(std::max(footprint_px, 1.0f) * 1.41421356f),
                                   0,
                                   static_cast<int>(levels_.size()) - 1);
  const RgbImage& level = levels_[static_cast<size_t>(level_idx)];
  const Eigen::Vector2f pixel = (position * static_cast<float>(level.width())).array() - 0.5f;
  const Eigen::Vector2f floor = pixel.array().floor();
  const Eigen::Vector2f weight = pixel - floor;
  const auto column = static_cast<int>(floor.x());
  const auto row = static_cast<int>(floor.y());
  const int x0 = Mirror(column, level.width());
  const int x1 = Mirror(column + 1, level.width());
  const int y0 = Mirror(row, level.height());
  const int y1 = Mirror(row + 1, level.height());
  const Eigen::Vector3f top =
      ToColour(level(x0, y0)) * (1.0f - weight.x()) + ToColour(level(x1, y0)) * weight.x();
  const Eigen::Vector3f bottom =
      ToColour(level(x0, y1)) * (1.0f - weight.x()) + ToColour(level(x1, y1)) * weight.x();
  return top * (1.0f - weight.y()) + bottom * weight.y();
}

std::vector<PhotoTexture> ReadPhotoTextures(const std::filesystem::path& folder) {
  constexpr size_t kMaxPhotos = 256;
  const std::vector<std::string> names = ListImages(folder);
  const size_t num_photos = std::min(kMaxPhotos, names.size());
  std::vector<std::optional<PhotoTexture>> loaded(num_photos);
  ParallelFor(static_cast<int64_t>(num_photos), 0, [&](int64_t i) {
    const auto photo_idx = static_cast<size_t>(i);
    loaded[photo_idx].emplace(ReadRgbImage(folder / names[photo_idx * names.size() / num_photos]));
  });
  std::vector<PhotoTexture> photos;
  for (auto& photo : loaded) photos.push_back(std::move(*photo));
  return photos;
}

}  // namespace vgtw
