// SPDX-License-Identifier: BSD-3-Clause
#include "scene/point_colors.h"

#include "scene/image_io.h"
#include "scene/parallel.h"

#include <array>
#include <cmath>
#include <map>
#include <mutex>
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

}  // namespace

void ColorPoints(const std::filesystem::path& image_path,
                 Reconstruction& model,
                 int num_threads,
                 const ProgressCallback& progress) {
  std::vector<const Image*> images;
  for (const auto& [id, image] : model.images) {
    if (std::filesystem::exists(image_path / image.name)) images.push_back(&image);
  }
  std::map<Point3DId, ColorSum> sums;
  std::mutex mutex;
  const auto add_image = [&](int64_t idx) {
    const Image& image = *images[static_cast<size_t>(idx)];
    const RgbImage photo = ReadRgbImage(image_path / image.name);
    std::vector<std::pair<Point3DId, Rgb>> colors;
    for (const Point2D& point2D : image.points2D) {
      const int x = static_cast<int>(std::floor(point2D.xy.x()));
      const int y = static_cast<int>(std::floor(point2D.xy.y()));
      if (!point2D.HasPoint3D() || x < 0 || y < 0 || x >= photo.width() || y >= photo.height()) {
        continue;
      }
      colors.emplace_back(point2D.point3D_id, photo(x, y));
    }
    const std::lock_guard lock(mutex);
    for (const auto& [point3D_id, color] : colors) sums[point3D_id].Add(color);
  };
  ParallelFor(static_cast<int64_t>(images.size()), num_threads, add_image, progress);
  for (const auto& [point3D_id, sum] : sums) {
    for (size_t i = 0; i < 3; ++i) {
      model.points3D.at(point3D_id).rgb[i] =
          static_cast<uint8_t>((sum.rgb[i] + sum.num / 2) / sum.num);
    }
  }
}

}  // namespace vgtw
