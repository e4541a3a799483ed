// SPDX-License-Identifier: BSD-3-Clause
#include "matching/feature_grid.h"

#include "scene/error.h"

namespace vgtw {
namespace {

// A few per cell: fewer cells to visit in large windows, few pixels in vain in small ones.
constexpr double kPixelsPerCell = 4.0;
constexpr double kMaxCellsPerSide = 1024.0;

}  // namespace

FeatureGrid::FeatureGrid(const std::vector<Eigen::Vector2f>& pixels, float width, float height)
    : pixels_(&pixels) {
  VGTW_CHECK(width > 0.0f && std::isfinite(width), "width of the grid");
  VGTW_CHECK(height > 0.0f && std::isfinite(height), "height of the grid");
  const double area = static_cast<double>(width) * height;
  const double num_pixels = std::max<double>(1.0, static_cast<double>(pixels.size()));
  cell_px_ = static_cast<float>(std::max(std::sqrt(area * kPixelsPerCell / num_pixels),
                                         std::max(width, height) / kMaxCellsPerSide));
  num_columns_ = std::max(1, static_cast<int>(std::ceil(width / cell_px_)));
  num_rows_ = std::max(1, static_cast<int>(std::ceil(height / cell_px_)));
  const auto cell_of = [&](const Eigen::Vector2f& pixel) {
    return static_cast<size_t>(CellOf(pixel.y(), num_rows_) * num_columns_ +
                               CellOf(pixel.x(), num_columns_));
  };
  first_in_cell_.assign(static_cast<size_t>(num_columns_ * num_rows_) + 1, 0);
  for (const Eigen::Vector2f& pixel : pixels) ++first_in_cell_[cell_of(pixel) + 1];
  for (size_t i = 1; i < first_in_cell_.size(); ++i) first_in_cell_[i] += first_in_cell_[i - 1];
  idxs_.resize(pixels.size());
  std::vector<uint32_t> next(first_in_cell_.begin(), first_in_cell_.end() - 1);
  for (uint32_t i = 0; i < pixels.size(); ++i) idxs_[next[cell_of(pixels[i])]++] = i;
}

FeatureGrid::Range FeatureGrid::ColumnsIn(const Capsule& capsule, int row) const {
  // The part of the axis that comes within the radius of the row's cells, vertically.
  const float top = static_cast<float>(row) * cell_px_ - capsule.radius;
  const float bottom = static_cast<float>(row + 1) * cell_px_ + capsule.radius;
  const Eigen::Vector2f axis = capsule.end - capsule.start;
  float first = 0.0f;
  float last = 1.0f;
  // Pixels outside of the image lie in the outermost rows, whatever their height.
  if (axis.y() != 0.0f) {
    const float at_top = (top - capsule.start.y()) / axis.y();
    const float at_bottom = (bottom - capsule.start.y()) / axis.y();
    if (row > 0) first = std::max(first, axis.y() > 0.0f ? at_top : -1.0f);
    if (row > 0) last = std::min(last, axis.y() > 0.0f ? 2.0f : at_top);
    if (row + 1 < num_rows_) first = std::max(first, axis.y() > 0.0f ? -1.0f : at_bottom);
    if (row + 1 < num_rows_) last = std::min(last, axis.y() > 0.0f ? at_bottom : 2.0f);
  }
  if (first > last) return {0, 0};
  const float x1 = capsule.start.x() + first * axis.x();
  const float x2 = capsule.start.x() + last * axis.x();
  return {CellOf(std::min(x1, x2) - capsule.radius, num_columns_),
          CellOf(std::max(x1, x2) + capsule.radius, num_columns_) + 1};
}

}  // namespace vgtw
