// SPDX-License-Identifier: BSD-3-Clause
#include "network/camera_geometry.h"

#include <ATen/ATen.h>
#include <Eigen/Geometry>

namespace vgtw {
namespace {

struct PixelGrid {
  at::Tensor u;  // [1, W]
  at::Tensor v;  // [H, 1]
};

PixelGrid IntegerGrid(int64_t height, int64_t width, const at::TensorOptions& options) {
  return {at::arange(width, options).unsqueeze(0), at::arange(height, options).unsqueeze(1)};
}

}  // namespace

at::Tensor RotationsFromQuaternions(const at::Tensor& quaternions_xyzw) {
  const std::vector<at::Tensor> parts = quaternions_xyzw.unbind(1);
  const at::Tensor& x = parts[0];
  const at::Tensor& y = parts[1];
  const at::Tensor& z = parts[2];
  const at::Tensor& w = parts[3];
  const at::Tensor s = 2.0 / quaternions_xyzw.square().sum(1);
  const at::Tensor entries = at::stack({1.0 - s * (y * y + z * z),
                                        s * (x * y - z * w),
                                        s * (x * z + y * w),
                                        s * (x * y + z * w),
                                        1.0 - s * (x * x + z * z),
                                        s * (y * z - x * w),
                                        s * (x * z - y * w),
                                        s * (y * z + x * w),
                                        1.0 - s * (x * x + y * y)},
                                       1);
  return entries.view({-1, 3, 3});
}

CameraMatrices DecodePoses(const at::Tensor& encodings, int64_t height, int64_t width) {
  const at::Tensor rotations = RotationsFromQuaternions(encodings.slice(1, 3, 7));
  const at::Tensor translations = encodings.slice(1, 0, 3).unsqueeze(2);
  const double half_height = 0.5 * static_cast<double>(height);
  const double half_width = 0.5 * static_cast<double>(width);
  const at::Tensor fy = half_height / at::tan(0.5 * encodings.select(1, 7));
  const at::Tensor fx = half_width / at::tan(0.5 * encodings.select(1, 8));
  const at::Tensor zero = at::zeros_like(fx);
  const at::Tensor intrinsics = at::stack({fx,
                                           zero,
                                           at::full_like(fx, half_width),
                                           zero,
                                           fy,
                                           at::full_like(fx, half_height),
                                           zero,
                                           zero,
                                           at::ones_like(fx)},
                                          1);
  return {at::cat({rotations, translations}, 2), intrinsics.view({-1, 3, 3})};
}

at::Tensor EncodePoses(const CameraMatrices& cameras, int64_t height, int64_t width) {
  const auto field_of_view = [&](int64_t axis, int64_t num_pixels) {
    const at::Tensor focal_length = cameras.intrinsics.select(1, axis).select(1, axis);
    return 2.0 * at::atan(0.5 * static_cast<double>(num_pixels) / focal_length).unsqueeze(1);
  };
  return at::cat({cameras.cam_from_world.select(2, 3),
                  QuaternionsFromRotations(cameras.cam_from_world.slice(2, 0, 3)),
                  field_of_view(1, height),
                  field_of_view(0, width)},
                 1);
}

at::Tensor InvertPoses(const at::Tensor& poses) {
  const at::Tensor inverse = poses.slice(2, 0, 3).transpose(1, 2);
  return at::cat({inverse, -at::matmul(inverse, poses.slice(2, 3))}, 2);
}

at::Tensor QuaternionsFromRotations(const at::Tensor& rotations) {
  const at::Tensor matrices = rotations.detach().to(at::kCPU, at::kDouble).contiguous();
  const at::Tensor quaternions = at::empty({matrices.size(0), 4}, matrices.options());
  for (int64_t i = 0; i < matrices.size(0); ++i) {
    using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    Eigen::Quaterniond q(Eigen::Matrix3d(Eigen::Map<const Rows>(matrices[i].data_ptr<double>())));
    q.normalize();
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();
    Eigen::Map<Eigen::Vector4d>(quaternions[i].data_ptr<double>()) = q.coeffs();  // xyzw
  }
  return quaternions.to(rotations.options());
}

at::Tensor NearestRotations(const at::Tensor& raw) {
  const at::Tensor rows = raw.view({-1, 3, 3});
  const at::Tensor lengths = rows.norm(2, {2}, /*keepdim=*/true).clamp_min(1e-12);
  const auto [u, s, vh] = at::linalg_svd((rows / lengths).transpose(1, 2));
  const at::Tensor v = vh.transpose(1, 2);
  const at::Tensor ut = u.transpose(1, 2);
  // A reflection becomes a rotation by turning the axis of the smallest singular value.
  const at::Tensor sign = at::det(at::matmul(v, ut));
  const at::Tensor ones = at::ones_like(sign);
  return at::matmul(v * at::stack({ones, ones, sign}, 1).unsqueeze(1), ut);
}

at::Tensor Unproject(const at::Tensor& depth, const CameraMatrices& cameras) {
  const PixelGrid grid = IntegerGrid(depth.size(1), depth.size(2), depth.options());
  const auto entry = [&](int64_t row, int64_t column) {
    return cameras.intrinsics.select(1, row).select(1, column).view({-1, 1, 1});
  };
  const at::Tensor in_cam = at::stack({(grid.u - entry(0, 2)) * depth / entry(0, 0),
                                       (grid.v - entry(1, 2)) * depth / entry(1, 1),
                                       depth},
                                      3);  // [S, H, W, 3]
  const at::Tensor rotations = cameras.cam_from_world.slice(2, 0, 3);
  const at::Tensor translations = cameras.cam_from_world.slice(2, 3).transpose(1, 2);
  // R^T (x - t) for rows of points.
  const at::Tensor points = in_cam.flatten(1, 2) - translations;
  return at::bmm(points, rotations).view(in_cam.sizes());
}

}  // namespace vgtw
