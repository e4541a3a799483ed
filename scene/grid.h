// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/error.h"

#include <cstddef>
#include <utility>
#include <vector>

namespace vgtw {

// A row-major [height,width] array. Element (x, y) covers the pixel whose centre is
// (x + 0.5, y + 0.5). Elements without a value are zero, also Eigen's, which T{} leaves unset.
template <typename T>
class Grid {
 public:
  Grid() = default;
  Grid(int width, int height, T value = Zero())
      : width_(width), height_(height), data_(CheckedSize(width, height), value) {}
  Grid(int width, int height, std::vector<T>&& data)
      : width_(width), height_(height), data_(std::move(data)) {
    VGTW_CHECK(data_.size() == CheckedSize(width, height), "grid data has another size");
  }

  int width() const { return width_; }
  int height() const { return height_; }
  bool empty() const { return data_.empty(); }
  size_t size() const { return data_.size(); }

  T& operator()(int x, int y) { return data_[Index(x, y)]; }
  const T& operator()(int x, int y) const { return data_[Index(x, y)]; }
  bool Contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

  std::vector<T>& data() { return data_; }
  const std::vector<T>& data() const { return data_; }

  bool operator==(const Grid&) const = default;

 private:
  static T Zero() {
    if constexpr (requires { T::Zero(); }) {
      return T::Zero();
    } else {
      return T{};
    }
  }
  static size_t CheckedSize(int width, int height) {
    VGTW_CHECK(width >= 0 && height >= 0, "grid size is negative");
    return static_cast<size_t>(width) * static_cast<size_t>(height);
  }
  size_t Index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<T> data_;
};

}  // namespace vgtw
