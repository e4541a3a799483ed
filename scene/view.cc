// SPDX-License-Identifier: BSD-3-Clause
#include "scene/view.h"

#include "scene/error.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace vgtw {
namespace {

constexpr int kPatchSize = 14;

// Python's round(): halves go to the even neighbour.
double RoundHalfToEven(double value) {
  const double floor = std::floor(value);
  const double fraction = value - floor;
  if (fraction != 0.5) return std::floor(value + 0.5);
  return std::fmod(floor, 2.0) == 0.0 ? floor : floor + 1.0;
}

// `side` after the other side went from `other_side` to `other_target`, in whole patches. The order
// of operations is the loader's, so that ties fall as they do there.
int ScaledSide(uint64_t side, uint64_t other_side, int other_target) {
  const double scale = static_cast<double>(other_target) / static_cast<double>(other_side);
  const double num_patches = RoundHalfToEven(static_cast<double>(side) * scale / kPatchSize);
  VGTW_CHECK(num_patches >= 1.0, "the image is too narrow for this loader");
  VGTW_CHECK(num_patches <= 1e6, "the image is too long for this loader");
  return kPatchSize * static_cast<int>(num_patches);
}

// The map of a resize from `original` to `resized` pixels, of which the network sees the part that
// starts at `offset` (negative where bars were added).
PixelMap MakePixelMap(const Eigen::Vector2d& original,
                      const Eigen::Vector2d& resized,
                      const Eigen::Vector2d& offset) {
  const Eigen::Vector2d scale = original.cwiseQuotient(resized);
  PixelMap original_from_network;
  original_from_network.leftCols<2>() = scale.asDiagonal();
  original_from_network.col(2) = scale.cwiseProduct(offset);
  return original_from_network;
}

NetworkGeometry MakeCropGeometry(uint64_t width, uint64_t height, int target) {
  const int resized_height = ScaledSide(height, width, target);
  const int first_row = std::max(0, (resized_height - target) / 2);
  const auto original = Eigen::Vector2d(width, height);
  return {target,
          std::min(resized_height, target),
          MakePixelMap(original, {target, resized_height}, {0.0, first_row})};
}

NetworkGeometry MakePadGeometry(uint64_t width, uint64_t height, int target) {
  const int resized_width = width >= height ? target : ScaledSide(width, height, target);
  const int resized_height = width >= height ? ScaledSide(height, width, target) : target;
  const auto original = Eigen::Vector2d(width, height);
  const NetworkGeometry resized = {
      resized_width,
      resized_height,
      MakePixelMap(original, {resized_width, resized_height}, Eigen::Vector2d::Zero())};
  return PadGeometry(resized, target, target);
}

NetworkGeometry MakeSquarePadGeometry(uint64_t width, uint64_t height, int target) {
  const uint64_t side = std::max(width, height);
  const auto bars = Eigen::Vector2d((side - width) / 2, (side - height) / 2);
  const double scale = static_cast<double>(side) / target;
  PixelMap original_from_network;
  original_from_network << scale, 0.0, -bars.x(), 0.0, scale, -bars.y();
  return {target, target, original_from_network};
}

}  // namespace

PixelMap IdentityPixelMap() { return PixelMap::Identity(); }

PixelMap Inverse(const PixelMap& b_from_a) {
  const Eigen::Matrix2d linear = b_from_a.leftCols<2>();
  const double determinant = linear.determinant();
  VGTW_CHECK(std::isnormal(determinant), "the pixel map has no inverse");
  PixelMap a_from_b;
  a_from_b.leftCols<2>() = linear.inverse();
  a_from_b.col(2) = -(a_from_b.leftCols<2>() * b_from_a.col(2));
  return a_from_b;
}

Eigen::Vector2d Apply(const PixelMap& b_from_a, const Eigen::Vector2d& pixel_in_a) {
  return b_from_a.leftCols<2>() * pixel_in_a + b_from_a.col(2);
}

NetworkGeometry MakeNetworkGeometry(ResizePolicy policy,
                                    uint64_t original_width,
                                    uint64_t original_height,
                                    int network_width,
                                    int network_height) {
  VGTW_CHECK(original_width > 0 && original_height > 0, "the image is empty");
  VGTW_CHECK(network_width > 0, "the network's input is empty");
  switch (policy) {
    case ResizePolicy::kCrop:
      return MakeCropGeometry(original_width, original_height, network_width);
    case ResizePolicy::kPad:
      return MakePadGeometry(original_width, original_height, network_width);
    case ResizePolicy::kSquarePad:
      return MakeSquarePadGeometry(original_width, original_height, network_width);
    case ResizePolicy::kStretch:
      break;
  }
  VGTW_CHECK(network_height > 0, "the network's input is empty");
  return {network_width,
          network_height,
          MakePixelMap(Eigen::Vector2d(original_width, original_height),
                       Eigen::Vector2d(network_width, network_height),
                       Eigen::Vector2d::Zero())};
}

NetworkGeometry PadGeometry(const NetworkGeometry& geometry,
                            int network_width,
                            int network_height) {
  VGTW_CHECK(network_width >= geometry.network_width && network_height >= geometry.network_height,
             "the padded canvas is smaller than the image");
  const Eigen::Vector2d first_pixel((network_width - geometry.network_width) / 2,
                                    (network_height - geometry.network_height) / 2);
  NetworkGeometry padded = {network_width, network_height, geometry.original_from_network};
  padded.original_from_network.col(2) -= geometry.original_from_network.leftCols<2>() * first_pixel;
  return padded;
}

Camera NetworkCamera(const View& view) {
  const PixelMap& map = view.original_from_network;
  VGTW_CHECK(view.camera.model == CameraModel::kPinhole ||
                 view.camera.model == CameraModel::kSimplePinhole,
             "a camera with distortion has no pinhole of network pixels");
  VGTW_CHECK(map(0, 1) == 0.0 && map(1, 0) == 0.0 && map(0, 0) > 0.0 && map(1, 1) > 0.0,
             "the pixel map turns or mirrors the image");
  VGTW_CHECK(view.network_width > 0 && view.network_height > 0, "the view has no network pixels");
  Camera camera = MakePinhole(static_cast<uint64_t>(view.network_width),
                              static_cast<uint64_t>(view.network_height),
                              view.camera.FocalLengthX() / map(0, 0),
                              view.camera.FocalLengthY() / map(1, 1));
  camera.camera_id = view.camera.camera_id;
  camera.has_prior_focal_length = view.camera.has_prior_focal_length;
  camera.SetPrincipalPoint(Apply(Inverse(map), view.camera.PrincipalPoint()));
  return camera;
}

}  // namespace vgtw
