// SPDX-License-Identifier: BSD-3-Clause
#include "network/grid_tensors.h"

#include <ATen/ATen.h>

namespace vgtw {
namespace {

template <typename T>
at::Tensor Borrow(const Grid<T>& grid, at::IntArrayRef shape, at::ScalarType type) {
  return at::from_blob(const_cast<T*>(grid.data().data()), shape, at::TensorOptions(type));
}

}  // namespace

at::Tensor ToTensor(const RgbImage& image) {
  static_assert(sizeof(Rgb) == 3, "pixels lie one after the other");
  const at::Tensor bytes = Borrow(image, {image.height(), image.width(), 3}, at::kByte);
  return bytes.permute({2, 0, 1}).to(at::kFloat).div_(255.0);
}

at::Tensor ToTensor(const Grid<float>& map) {
  return Borrow(map, {map.height(), map.width()}, at::kFloat).clone();
}

at::Tensor ToTensor(const Grid<uint8_t>& map) {
  return Borrow(map, {map.height(), map.width()}, at::kByte).clone();
}

}  // namespace vgtw
