// SPDX-License-Identifier: BSD-3-Clause
#include "scene/depth_map.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vgtw {
namespace {

bool IsKnown(float depth) { return std::isfinite(depth) && depth > 0.0f; }

// The two pixels around a coordinate along one axis and the weight of the second.
struct Neighbours {
  int first = 0;
  int second = 0;
  double second_weight = 0.0;
};

// Within half a pixel of the border both neighbours are the border pixel.
Neighbours FindNeighbours(double coordinate, int size) {
  const double from_first_centre = std::clamp(coordinate - 0.5, 0.0, size - 1.0);
  const int first = static_cast<int>(from_first_centre);
  return {first, std::min(first + 1, size - 1), from_first_centre - first};
}

}  // namespace

std::optional<double> SampleDepth(const DepthMap& depth,
                                  const Eigen::Vector2d& pixel_in_network,
                                  double max_relative_step) {
  const double x = pixel_in_network.x();
  const double y = pixel_in_network.y();
  if (!(x >= 0.0 && y >= 0.0 && x < depth.width() && y < depth.height())) return std::nullopt;
  const Neighbours columns = FindNeighbours(x, depth.width());
  const Neighbours rows = FindNeighbours(y, depth.height());
  double sum = 0.0;
  double min = HUGE_VAL;
  double max = 0.0;
  for (const auto& [row, row_weight] : {std::pair(rows.first, 1.0 - rows.second_weight),
                                        std::pair(rows.second, rows.second_weight)}) {
    for (const auto& [column, column_weight] :
         {std::pair(columns.first, 1.0 - columns.second_weight),
          std::pair(columns.second, columns.second_weight)}) {
      // At a pixel's centre its neighbours have no say.
      if (row_weight * column_weight == 0.0) continue;
      const float value = depth(column, row);
      if (!IsKnown(value)) return std::nullopt;
      sum += row_weight * column_weight * value;
      min = std::min<double>(min, value);
      max = std::max<double>(max, value);
    }
  }
  if (max - min > max_relative_step * min) return std::nullopt;
  return sum;
}

std::optional<Eigen::Vector3d> UnprojectPixel(const View& view,
                                              const DepthMap& depth,
                                              int x,
                                              int y) {
  VGTW_CHECK(depth.Contains(x, y), "the pixel lies outside the depth map");
  if (!IsKnown(depth(x, y))) return std::nullopt;
  const Eigen::Vector2d pixel =
      Apply(view.original_from_network, Eigen::Vector2d(x + 0.5, y + 0.5));
  const std::optional<Eigen::Vector2d> ray = Unproject(view.camera, pixel);
  if (!ray) return std::nullopt;
  const Eigen::Vector3d point_in_cam = depth(x, y) * ray->homogeneous();
  return Inverse(view.cam_from_world) * point_in_cam;
}

DepthMap DepthFromPoints(const View& view, const Grid<Eigen::Vector3f>& points) {
  DepthMap depth(points.width(), points.height());
  for (size_t i = 0; i < points.size(); ++i) {
    const double z = (view.cam_from_world * points.data()[i].cast<double>()).z();
    depth.data()[i] = z > 0.0 ? static_cast<float>(z) : std::numeric_limits<float>::quiet_NaN();
  }
  return depth;
}

}  // namespace vgtw
