// SPDX-License-Identifier: BSD-3-Clause
#include "scene/point_colors.h"

#include "scene/image_io.h"
#include "scene/parallel.h"

#include <array>
#include <cmath>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

struct ColorSum {
  std::array<uint64_t, 3> rgb = {0, 0, 0};
  uint64_t num = 0;

  void Add(const Rgb& color) {
    for (size_t i = 0; i < 3; ++i) rgb[i] += color[i];
    ++num;
  }
};

using ColorSums = std::map<Point3DId, ColorSum>;

std::vector<std::pair<Point3DId, Rgb>> ColorsOf(const Image& image, const RgbImage& photo) {
  std::vector<std::pair<Point3DId, Rgb>> colors;
  for (const Point2D& point2D : image.points2D) {
    const int x = static_cast<int>(std::floor(point2D.xy.x()));
    const int y = static_cast<int>(std::floor(point2D.xy.y()));
    if (!point2D.HasPoint3D() || !photo.Contains(x, y)) continue;
    colors.emplace_back(point2D.point3D_id, photo(x, y));
  }
  return colors;
}

void SetColors(const ColorSums& sums, Reconstruction& model) {
  for (const auto& [point3D_id, sum] : sums) {
    for (size_t i = 0; i < 3; ++i) {
      model.points3D.at(point3D_id).rgb[i] =
          static_cast<uint8_t>((sum.rgb[i] + sum.num / 2) / sum.num);
    }
  }
}

}  // namespace

void ColorPoints(const std::filesystem::path& image_path,
                 std::span<Reconstruction* const> models,
                 int num_threads,
                 const ProgressCallback& progress) {
  if (models.empty()) return;
  std::vector<std::pair<ImageId, std::string>> images;
  for (const auto& [id, image] : models.front()->images) {
    if (std::filesystem::exists(image_path / image.name)) images.emplace_back(id, image.name);
  }
  std::vector<ColorSums> sums(models.size());
  std::mutex mutex;
  const auto add_image = [&](int64_t idx) {
    const auto& [image_id, name] = images[static_cast<size_t>(idx)];
    const RgbImage photo = ReadRgbImage(image_path / name);
    for (size_t i = 0; i < models.size(); ++i) {
      const auto colors = ColorsOf(models[i]->images.at(image_id), photo);
      const std::lock_guard lock(mutex);
      for (const auto& [point3D_id, color] : colors) sums[i][point3D_id].Add(color);
    }
  };
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, add_image, progress);
  for (size_t i = 0; i < models.size(); ++i) SetColors(sums[i], *models[i]);
}

void ColorPoints(const std::filesystem::path& image_path,
                 Reconstruction& model,
                 int num_threads,
                 const ProgressCallback& progress) {
  Reconstruction* const models[] = {&model};
  ColorPoints(image_path, models, num_threads, progress);
}

}  // namespace vgtw
