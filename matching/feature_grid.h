// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// All pixels within `radius` of the segment from `start` to `end`.
struct Capsule {
  Eigen::Vector2f start = Eigen::Vector2f::Zero();
  Eigen::Vector2f end = Eigen::Vector2f::Zero();
  float radius = 0.0f;

  float SquaredDistanceToAxis(const Eigen::Vector2f& pixel) const {
    const Eigen::Vector2f axis = end - start;
    const float length2 = axis.squaredNorm();
    const float along =
        length2 > 0.0f ? std::clamp((pixel - start).dot(axis) / length2, 0.0f, 1.0f) : 0.0f;
    return (start + along * axis - pixel).squaredNorm();
  }
};

// Pixels by square cells, for finding those in a capsule without looking at all.
class FeatureGrid {
 public:
  // `pixels` must outlive the grid; those outside of [0, width) x [0, height) count for the nearest
  // cell. Throws std::invalid_argument for sizes that are not positive and finite.
  FeatureGrid(const std::vector<Eigen::Vector2f>& pixels, float width, float height);

  // Calls visit(idx) for every pixel in the capsule, in an order that depends on the grid alone.
  template <typename Visit>
  void ForEachIn(const Capsule& capsule, const Visit& visit) const;

 private:
  struct Range {
    int begin, end;  // cells
  };
  int CellOf(float coordinate, int num_cells) const {
    if (!(coordinate > 0.0f)) return 0;  // also for NaN, which no window holds
    return static_cast<int>(std::min(coordinate / cell_px_, static_cast<float>(num_cells - 1)));
  }
  // Columns of the cells that the capsule touches in a row of cells.
  Range ColumnsIn(const Capsule& capsule, int row) const;

  const std::vector<Eigen::Vector2f>* pixels_;
  float cell_px_ = 1.0f;
  int num_columns_ = 1;
  int num_rows_ = 1;
  std::vector<uint32_t> first_in_cell_;  // into idxs_, one past the last cell too
  std::vector<uint32_t> idxs_;
};

template <typename Visit>
void FeatureGrid::ForEachIn(const Capsule& capsule, const Visit& visit) const {
  const float radius2 = capsule.radius * capsule.radius;
  const int first_row =
      CellOf(std::min(capsule.start.y(), capsule.end.y()) - capsule.radius, num_rows_);
  const int last_row =
      CellOf(std::max(capsule.start.y(), capsule.end.y()) + capsule.radius, num_rows_);
  for (int row = first_row; row <= last_row; ++row) {
    const Range columns = ColumnsIn(capsule, row);
    const size_t first_cell = static_cast<size_t>(row * num_columns_);
    const uint32_t end = first_in_cell_[first_cell + static_cast<size_t>(columns.end)];
    for (uint32_t k = first_in_cell_[first_cell + static_cast<size_t>(columns.begin)]; k < end;
         ++k) {
      if (capsule.SquaredDistanceToAxis((*pixels_)[idxs_[k]]) <= radius2) visit(idxs_[k]);
    }
  }
}

}  // namespace vgtw
