// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"

#include "scene/error.h"

#include <algorithm>
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

// The first of these keys that the store has.
std::optional<std::string> FindKey(const ArrayStore& store,
                                   std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (store.Contains(key)) return key;
  }
  return std::nullopt;
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

ArrayViews::ArrayViews(const ArrayStore& store) {
  extrinsic_ =
      OpenMatrices(store, FindKey(store, {"extrinsic", "extrinsics"}).value_or("extrinsic"), 4);
  if (const auto key = FindKey(store, {"intrinsic", "intrinsics"})) {
    intrinsic_ = OpenMatrices(store, *key, 3);
  }
  if (store.Contains("depth")) depth_ = OpenMaps(store, "depth", 1);
  if (const auto key = FindKey(store, {"depth_conf", "conf"}))
    depth_conf_ = OpenMaps(store, *key, 1);
  if (store.Contains("world_points")) points_ = OpenMaps(store, "world_points", 3);
  if (const auto key = FindKey(store, {"depth_mask", "depth_mask_binary"})) {
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
  if (depth_) {
    view.depth = NextMap(depth_->reader, *map_size_);
    ForgetNonPositive(view.depth);
  }
  if (depth_conf_) view.depth_conf = NextMap(depth_conf_->reader, *map_size_);
  if (distractor_) view.distractor = NextDistractor();
  if (points_) {
    static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
    view.points = Grid<Eigen::Vector3f>(map_size_->width, map_size_->height);
    points_->reader.Read(
        std::span<float>(view.points.data().front().data(), 3 * view.points.size()));
    for (Eigen::Vector3f& point : view.points.data()) {
      if (!point.allFinite()) point.setConstant(kUnknown);
    }
  }
  return view;
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
