// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

namespace vgtw {
namespace {

constexpr uint64_t kMaxViews = 1 << 20;
constexpr uint64_t kMaxMapSide = 1 << 15;
constexpr uint64_t kMaxMapPixels = 1 << 28;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

[[noreturn]] void FailShape(const NpyReader& reader, const std::string& expected) {
  Fail(reader.origin(), "has shape " + ShapeText(reader.shape()), expected);
}

// [S, ...] with `num_dimensions` dimensions in all: drops a leading batch of 1, adds S = 1.
std::vector<uint64_t> StackShape(std::vector<uint64_t> shape, size_t num_dimensions) {
  if (shape.size() == num_dimensions + 1 && shape.front() == 1) shape.erase(shape.begin());
  if (shape.size() + 1 == num_dimensions) shape.insert(shape.begin(), 1);
  return shape;
}

Grid<float> NextMap(NpyReader& reader, const MapSize& size) {
  Grid<float> map(size.width, size.height);
  reader.Read(std::span<float>(map.data()));
  for (float& value : map.data()) {
    if (!std::isfinite(value)) value = kUnknown;
  }
  return map;
}

bool IsUsableSize(uint64_t height, uint64_t width) {
  return height >= 2 && width >= 2 && height <= kMaxMapSide && width <= kMaxMapSide &&
         height * width <= kMaxMapPixels;
}

}  // namespace

std::optional<std::string> FindKey(const ArrayStore& store, const ArrayKeys::Words& words) {
  for (const std::string& word : words) {
    if (store.Contains(word)) return word;
  }
  return std::nullopt;
}

MapSize SingleMapSize(const NpyReader& reader) {
  std::vector<uint64_t> shape = reader.shape();
  if (shape.size() > 2 && shape.back() == 1) shape.pop_back();
  shape = StackShape(std::move(shape), 3);
  if (shape.size() != 3 || shape[0] != 1 || !IsUsableSize(shape[1], shape[2])) {
    FailShape(reader, "(H, W), at most 2^28 pixels");
  }
  return {static_cast<int>(shape[2]), static_cast<int>(shape[1])};
}

Grid<float> ReadSingleMap(NpyReader& reader) { return NextMap(reader, SingleMapSize(reader)); }

void ForgetNonPositive(DepthMap& depth) {
  for (float& value : depth.data()) {
    if (!(value > 0.0f)) value = kUnknown;
  }
}

std::optional<ArrayViews::Stack> ArrayViews::OpenMatrices(const ArrayStore& store,
                                                          const std::string& key,
                                                          size_t num_columns) {
  Stack stack{store.Open(key), 0, {}};
  const std::vector<uint64_t> shape = StackShape(stack.reader.shape(), 3);
  const bool fits = shape.size() == 3 && shape[0] >= 1 && shape[0] <= kMaxViews &&
                    (shape[1] == 3 || (num_columns == 4 && shape[1] == 4)) &&
                    shape[2] == num_columns;
  if (!fits) {
    FailShape(stack.reader, num_columns == 4 ? "(S, 3, 4) or (S, 4, 4)" : "(S, 3, 3)");
  }
  stack.num_views = shape[0];
  stack.view_shape = {shape[1], shape[2]};
  Agree(stack);
  return stack;
}

std::optional<ArrayViews::Stack> ArrayViews::OpenVectors(const ArrayStore& store,
                                                         const std::string& key) {
  Stack stack{store.Open(key), 0, {1}};
  const std::vector<uint64_t>& shape = stack.reader.shape();
  if (shape.size() == 2) stack.view_shape = {shape[1]};
  const bool fits = (shape.size() == 1 || shape.size() == 2) && shape[0] >= 1 &&
                    shape[0] <= kMaxViews && (stack.view_shape[0] == 1 || stack.view_shape[0] == 2);
  if (!fits) FailShape(stack.reader, "(S,), (S, 1) or (S, 2)");
  stack.num_views = shape[0];
  Agree(stack);
  return stack;
}

std::optional<ArrayViews::Stack> ArrayViews::OpenMaps(const ArrayStore& store,
                                                      const std::string& key,
                                                      uint64_t num_channels) {
  Stack stack{store.Open(key), 0, {}};
  std::vector<uint64_t> shape = stack.reader.shape();
  if (num_channels == 1) {
    // [S,H,W,1]; maps of a single column do not exist.
    if (shape.size() > 2 && shape.back() == 1) shape.pop_back();
    shape = StackShape(std::move(shape), 3);
    shape.push_back(1);
  }
  shape = StackShape(std::move(shape), 4);
  const bool fits = shape.size() == 4 && shape[0] >= 1 && shape[0] <= kMaxViews &&
                    IsUsableSize(shape[1], shape[2]) && shape[3] == num_channels;
  if (!fits) {
    FailShape(stack.reader,
              num_channels == 1 ? "(S, H, W) or (S, H, W, 1), at most 2^28 pixels a view"
                                : "(S, H, W, 3), at most 2^28 pixels a view");
  }
  stack.num_views = shape[0];
  const MapSize size{static_cast<int>(shape[2]), static_cast<int>(shape[1])};
  if (map_size_ && size != *map_size_) {
    FailShape(stack.reader,
              "maps of " + std::to_string(map_size_->height) + " rows and " +
                  std::to_string(map_size_->width) + " columns like the other arrays");
  }
  map_size_ = size;
  Agree(stack);
  return stack;
}

void ArrayViews::Agree(const Stack& stack) {
  if (num_views_ == 0) num_views_ = stack.num_views;
  if (stack.num_views != num_views_) {
    FailShape(stack.reader, std::to_string(num_views_) + " views like the other arrays");
  }
}

ArrayViews::ArrayViews(const ArrayStore& store, const ArrayKeys& keys) {
  const auto find = [&](const ArrayKeys::Words& words) { return FindKey(store, words); };
  extrinsic_ = OpenMatrices(store, find(keys.extrinsic).value_or(keys.extrinsic.front()), 4);
  if (const auto key = find(keys.intrinsic)) intrinsic_ = OpenMatrices(store, *key, 3);
  if (const auto key = find(keys.focal)) focal_ = OpenVectors(store, *key);
  if (const auto key = find(keys.principal_point)) principal_point_ = OpenVectors(store, *key);
  if (const auto key = find(keys.depth)) depth_ = OpenMaps(store, *key, 1);
  if (const auto key = find(keys.depth_conf)) depth_conf_ = OpenMaps(store, *key, 1);
  if (const auto key = find(keys.points)) points_ = OpenMaps(store, *key, 3);
  if (const auto key = find(keys.valid)) valid_ = OpenMaps(store, *key, 1);
  if (const auto key = find(keys.distractor)) {
    distractor_ = OpenMaps(store, *key, 1);
    is_logit_ = *key == "depth_mask" && distractor_->reader.IsFloatingPoint();
  }
}

ViewArrays ArrayViews::Next() {
  ViewArrays view;
  std::array<double, 16> values{};
  const size_t num_values = extrinsic_->view_shape[0] * 4;
  extrinsic_->reader.Read(std::span<double>(values).first(num_values));
  view.extrinsic = Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(values.data());
  if (intrinsic_) {
    intrinsic_->reader.Read(std::span<double>(values).first(9));
    view.intrinsic = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data());
  }
  view.focal = NextVector(focal_);
  view.principal_point = NextVector(principal_point_);
  if (depth_) {
    view.depth = NextMap(depth_->reader, *map_size_);
    ForgetNonPositive(view.depth);
  }
  if (depth_conf_) view.depth_conf = NextMap(depth_conf_->reader, *map_size_);
  if (distractor_) view.distractor = NextDistractor();
  if (points_) view.points = NextPoints();
  if (valid_) ForgetInvalid(view);
  return view;
}

// A single number is both.
std::optional<Eigen::Vector2d> ArrayViews::NextVector(std::optional<Stack>& stack) {
  if (!stack) return std::nullopt;
  std::array<double, 2> values{};
  const size_t num_values = stack->view_shape[0];
  stack->reader.Read(std::span<double>(values).first(num_values));
  return Eigen::Vector2d(values[0], values[num_values - 1]);
}

Grid<Eigen::Vector3f> ArrayViews::NextPoints() {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
  Grid<Eigen::Vector3f> points(map_size_->width, map_size_->height);
  points_->reader.Read(std::span<float>(points.data().front().data(), 3 * points.size()));
  for (Eigen::Vector3f& point : points.data()) {
    if (!point.allFinite()) point.setConstant(kUnknown);
  }
  return points;
}

void ArrayViews::ForgetInvalid(ViewArrays& view) {
  const Grid<float> valid = NextMap(valid_->reader, *map_size_);
  for (size_t i = 0; i < valid.size(); ++i) {
    if (valid.data()[i] > 0.0f) continue;
    if (depth_) view.depth.data()[i] = kUnknown;
    if (points_) view.points.data()[i].setConstant(kUnknown);
  }
}

DistractorMask ArrayViews::NextDistractor() {
  DistractorMask mask(map_size_->width, map_size_->height);
  distractor_->reader.Read(std::span<float>(mask.data()));
  const auto is_binary = [](float value) { return value == 0.0f || value == 1.0f; };
  bool is_logit = is_logit_;
  if (is_logit && std::all_of(mask.data().begin(), mask.data().end(), is_binary)) {
    has_mask_without_logits_ = true;
    is_logit = false;
  }
  for (float& value : mask.data()) {
    if (std::isnan(value)) continue;
    value = is_logit ? 1.0f / (1.0f + std::exp(-value)) : (value > 0.5f ? 1.0f : 0.0f);
  }
  return mask;
}

}  // namespace vgtw
