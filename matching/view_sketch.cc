// SPDX-License-Identifier: BSD-3-Clause
#include "matching/view_sketch.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace vgtw {
namespace {

// A cell of the map of depth is meant to hold this many points at least.
constexpr double kMinPointsPerCell = 2.0;

struct CellEntry {
  float squared_distance = std::numeric_limits<float>::infinity();  // to the middle, in cells
  float depth = std::numeric_limits<float>::quiet_NaN();
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
};

// Cells over the image that keep the point nearest to their middle.
class CellGrid {
 public:
  CellGrid(const Camera& camera, int width, int height)
      : cells_(width, height),
        cells_per_px_(width / static_cast<double>(camera.width),
                      height / static_cast<double>(camera.height)) {}

  void Add(const StaticView::Point& point, double depth) {
    const Eigen::Array2d position = point.pixel_in_original.array() * cells_per_px_;
    if (!((position >= 0.0).all() && position.x() < cells_.width() &&
          position.y() < cells_.height())) {
      return;
    }
    const Eigen::Array2i idx = position.cast<int>();
    const auto squared_distance =
        static_cast<float>((position - idx.cast<double>() - 0.5).square().sum());
    CellEntry& cell = cells_(idx.x(), idx.y());
    if (squared_distance < cell.squared_distance) {
      cell = {squared_distance, static_cast<float>(depth), point.xyz};
    }
  }

  const Grid<CellEntry>& cells() const { return cells_; }

 private:
  Grid<CellEntry> cells_;
  Eigen::Array2d cells_per_px_;
};

// At most `max_cells` nearly square cells.
CellGrid MakeSquareCells(const Camera& camera, int max_cells) {
  const double aspect = static_cast<double>(camera.width) / static_cast<double>(camera.height);
  const int width =
      static_cast<int>(std::clamp(std::floor(std::sqrt(max_cells * aspect)), 1.0, max_cells + 0.0));
  // Of a very narrow image, too many rows would be left over for the cells to be square.
  const double square_height = std::ceil(width / aspect);
  return {camera, width, static_cast<int>(std::min(max_cells / width + 0.0, square_height))};
}

CellGrid MakeDepthCells(const Camera& camera, int map_size, size_t num_points) {
  const auto longer = static_cast<double>(std::max(camera.width, camera.height));
  const double shorter = static_cast<double>(std::min(camera.width, camera.height));
  const double filled =
      std::floor(std::sqrt(static_cast<double>(num_points) / kMinPointsPerCell * longer / shorter));
  const double size = std::clamp(filled, 1.0, static_cast<double>(map_size));
  const auto cells_along = [&](uint64_t side_px) {
    return std::max(1, static_cast<int>(std::lround(static_cast<double>(side_px) * size / longer)));
  };
  return {camera, cells_along(camera.width), cells_along(camera.height)};
}

void CheckRange(double value, double max, const std::string& name) {
  VGTW_CHECK(value >= 1.0 && value <= max,
             "ViewSketchOptions::" + name + " = " + std::to_string(value) + ", must be in [1, " +
                 std::to_string(max) + "]");
}

}  // namespace

void ViewSketchOptions::Check() const {
  CheckRange(max_points, 65536, "max_points");
  CheckRange(map_size, 4096, "map_size");
}

ViewSketch MakeViewSketch(const StaticView& view,
                          double confidence_threshold,
                          const ViewSketchOptions& options) {
  options.Check();
  const Camera& camera = view.view().camera;
  VGTW_CHECK(FindFault(camera).empty(), FindFault(camera));
  ViewSketch sketch;
  sketch.view = view.view();
  const std::vector<StaticView::Point> points = view.StaticPoints(confidence_threshold);
  if (points.empty()) return sketch;
  CellGrid spread = MakeSquareCells(camera, options.max_points);
  CellGrid map = MakeDepthCells(camera, options.map_size, points.size());
  for (const StaticView::Point& point : points) {
    const double depth = (sketch.view.cam_from_world * point.xyz).z();
    if (!(point.xyz.allFinite() && depth > 0.0)) continue;
    spread.Add(point, depth);
    map.Add(point, depth);
  }
  for (const CellEntry& cell : spread.cells().data()) {
    if (std::isfinite(cell.depth)) sketch.points.push_back(cell.xyz);
  }
  if (sketch.points.empty()) return sketch;
  sketch.depth = DepthMap(map.cells().width(), map.cells().height());
  std::transform(map.cells().data().begin(),
                 map.cells().data().end(),
                 sketch.depth.data().begin(),
                 [](const CellEntry& cell) { return cell.depth; });
  return sketch;
}

}  // namespace vgtw
