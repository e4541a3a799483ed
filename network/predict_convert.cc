// SPDX-License-Identifier: BSD-3-Clause
#include "network/predict_convert.h"

#include "network/camera_geometry.h"
#include "scene/network_pixels.h"
#include "scene/pinhole_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

at::Tensor ToCpu(const at::Tensor& tensor, at::ScalarType type) {
  return tensor.to(at::kCPU, type).contiguous();
}

Grid<Eigen::Vector3f> ToPointGrid(const at::Tensor& points) {
  if (!points.defined()) return {};
  const at::Tensor values = ToCpu(points, at::kFloat);
  Grid<Eigen::Vector3f> grid(static_cast<int>(values.size(1)), static_cast<int>(values.size(0)));
  const float* next = values.data_ptr<float>();
  for (Eigen::Vector3f& point : grid.data()) {
    point = Eigen::Map<const Eigen::Vector3f>(next);
    if (!point.allFinite()) point.setConstant(kUnknown);
    next += 3;
  }
  return grid;
}

template <int kRows, int kColumns>
Eigen::Matrix<double, kRows, kColumns> ToMatrix(const at::Tensor& tensor) {
  const at::Tensor values = ToCpu(tensor, at::kDouble);
  return Eigen::Map<const Eigen::Matrix<double, kRows, kColumns, Eigen::RowMajor>>(
      values.data_ptr<double>());
}

// [H, W]: 1 where the photo is, 0 on bars.
at::Tensor PhotoPixels(const PhotoPlacement& placement, const at::Tensor& like) {
  at::Tensor on_photo = at::zeros_like(like);
  on_photo.slice(0, placement.first_row, placement.end_row)
      .slice(1, placement.first_column, placement.end_column)
      .fill_(1.0);
  return on_photo;
}

// pi3's intrinsics in continuous network pixels; nullopt if its points fit no camera.
std::optional<Eigen::Matrix3d> FitIntrinsics(const PhotoPlacement& placement,
                                             const DenseOutputs& maps) {
  constexpr int64_t kMinStaticPixels = 1000;
  at::Tensor weights = PhotoPixels(placement, maps.depth_conf) * maps.depth_conf.sigmoid();
  if (maps.distractor_logits.defined()) {
    const at::Tensor is_static = maps.distractor_logits <= 0.0;
    if (is_static.sum().item<int64_t>() >= kMinStaticPixels) weights = weights * is_static;
  }
  const std::optional<PinholeFit> fit = FitPinhole(ToPointGrid(maps.local_points), ToGrid(weights));
  if (!fit) return std::nullopt;
  return fit->intrinsics;
}

at::Tensor WorldPoints(const RawView& raw) {
  if (!raw.maps.local_points.defined()) return raw.maps.points;
  const at::Tensor world_from_cam = InvertPoses(raw.cam_from_world.unsqueeze(0))[0];
  return at::matmul(raw.maps.local_points, world_from_cam.slice(1, 0, 3).t()) +
         world_from_cam.select(1, 3);
}

// A network that is lost gives no field of view or that of a fisheye.
bool HasUsableFieldOfView(const Eigen::Matrix3d& intrinsics, const NetworkGeometry& geometry) {
  constexpr double kMargin = 1e-3;  // rad
  const auto is_usable = [](double focal_length, int num_pixels) {
    const double field_of_view = 2.0 * std::atan(0.5 * num_pixels / focal_length);
    return field_of_view >= kMargin && field_of_view <= std::numbers::pi - kMargin;
  };
  return is_usable(intrinsics(0, 0), geometry.network_width) &&
         is_usable(intrinsics(1, 1), geometry.network_height);
}

// Sets the camera and the pose; returns why they cannot be used, or "".
std::string SetCamera(const PhotoPlacement& placement, const RawView& raw, View& view) {
  const std::optional<Eigen::Matrix3d> k = raw.intrinsics.defined()
                                               ? ToMatrix<3, 3>(raw.intrinsics)
                                               : FitIntrinsics(placement, raw.maps);
  if (!k) return "its points fit no pinhole camera";
  const std::optional<Camera> camera =
      CameraFromNetwork(*k, placement.geometry, placement.photo_size);
  if (!camera || !HasUsableFieldOfView(*k, placement.geometry)) {
    return "its field of view is near 0 or 180 degrees";
  }
  view.camera = *camera;
  const std::optional<Rigid3d> pose = RigidFromMatrix(ToMatrix<3, 4>(raw.cam_from_world));
  if (!pose) return "its pose is not finite";
  view.cam_from_world = *pose;
  return "";
}

void SetMaps(const RawView& raw, bool with_points, ViewPrediction& prediction) {
  const DenseOutputs& maps = raw.maps;
  prediction.depth = ToGrid(maps.depth);
  for (float& depth : prediction.depth.data()) {
    if (!(depth > 0.0f)) depth = kUnknown;
  }
  const bool conf_is_logit = maps.local_points.defined();
  prediction.depth_conf = ToGrid(conf_is_logit ? maps.depth_conf.sigmoid() : maps.depth_conf);
  if (maps.distractor_logits.defined()) {
    prediction.distractor = ToGrid(maps.distractor_logits.to(at::kFloat).sigmoid());
  }
  if (with_points) prediction.points = ToPointGrid(WorldPoints(raw));
}

}  // namespace

Grid<float> ToGrid(const at::Tensor& map) {
  if (!map.defined()) return {};
  const at::Tensor values = ToCpu(map, at::kFloat);
  Grid<float> grid(static_cast<int>(values.size(1)), static_cast<int>(values.size(0)));
  const float* first = values.data_ptr<float>();
  std::transform(first, first + grid.size(), grid.data().begin(), [](float value) {
    return std::isfinite(value) ? value : kUnknown;
  });
  return grid;
}

RawView SelectView(const CameraOutputs& cameras,
                   int64_t camera_idx,
                   const DenseOutputs& maps,
                   int64_t map_idx) {
  const auto select = [](const at::Tensor& tensor, int64_t idx) {
    return tensor.defined() ? tensor[idx] : tensor;
  };
  RawView raw;
  raw.cam_from_world = select(cameras.cam_from_world, camera_idx);
  raw.intrinsics = select(cameras.intrinsics, camera_idx);
  raw.maps.depth = select(maps.depth, map_idx);
  raw.maps.depth_conf = select(maps.depth_conf, map_idx);
  raw.maps.points = select(maps.points, map_idx);
  raw.maps.points_conf = select(maps.points_conf, map_idx);
  raw.maps.local_points = select(maps.local_points, map_idx);
  raw.maps.distractor_logits = select(maps.distractor_logits, map_idx);
  return raw;
}

ConvertedView ConvertView(const std::string& name,
                          const PhotoPlacement& placement,
                          const RawView& raw,
                          bool with_points) {
  ConvertedView converted;
  View& view = converted.prediction.view;
  view.name = name;
  view.network_width = placement.geometry.network_width;
  view.network_height = placement.geometry.network_height;
  view.original_from_network = placement.geometry.original_from_network;
  converted.fault = SetCamera(placement, raw, view);
  if (!converted.fault.empty()) return converted;
  SetMaps(raw, with_points, converted.prediction);
  ForgetBars(converted.prediction);
  const auto& depths = converted.prediction.depth.data();
  if (std::none_of(depths.begin(), depths.end(), [](float d) { return std::isfinite(d); })) {
    converted.fault = "its depth is not finite";
  } else {
    converted.fault = FindFault(converted.prediction);
  }
  return converted;
}

}  // namespace vgtw
