// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// COLMAP's camera models with its ids and its order of parameters.
enum class CameraModel : int {
  kSimplePinhole = 0,        // f, cx, cy
  kPinhole = 1,              // fx, fy, cx, cy
  kSimpleRadial = 2,         // f, cx, cy, k
  kRadial = 3,               // f, cx, cy, k1, k2
  kOpenCV = 4,               // fx, fy, cx, cy, k1, k2, p1, p2
  kOpenCVFisheye = 5,        // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpenCV = 6,           // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  kFOV = 7,                  // fx, fy, cx, cy, omega
  kSimpleRadialFisheye = 8,  // f, cx, cy, k
  kRadialFisheye = 9,        // f, cx, cy, k1, k2
  kThinPrismFisheye = 10,    // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
};
inline constexpr int kNumCameraModels = 11;

// One row of the table of models.
struct CameraModelInfo {
  CameraModel model;
  std::string_view name;  // COLMAP's, for instance "SIMPLE_RADIAL"
  int num_params;
  int num_focal_lengths;  // 1 (f) or 2 (fx, fy), always first; cx, cy follow
};
const CameraModelInfo& GetCameraModelInfo(CameraModel model);
std::optional<CameraModel> FindCameraModel(std::string_view name);
std::optional<CameraModel> FindCameraModel(int model_id);

// Intrinsics in original pixels; the centre of the first pixel is (0.5, 0.5).
struct Camera {
  uint32_t camera_id = 0;
  CameraModel model = CameraModel::kPinhole;
  uint64_t width = 0;
  uint64_t height = 0;
  std::vector<double> params;  // COLMAP's order
  bool has_prior_focal_length = false;

  double FocalLengthX() const;
  double FocalLengthY() const;
  double MeanFocalLength() const { return 0.5 * (FocalLengthX() + FocalLengthY()); }
  Eigen::Vector2d PrincipalPoint() const;
  void SetFocalLength(double focal_length_x, double focal_length_y);  // mean if the model has one f
  void SetPrincipalPoint(const Eigen::Vector2d& principal_point);
  // Parameters behind focal lengths and principal point.
  size_t FirstExtraParamIdx() const;

  bool operator==(const Camera&) const = default;
};

// PINHOLE with the given focal lengths and the principal point at the image centre.
Camera MakePinhole(uint64_t width, uint64_t height, double focal_length_x, double focal_length_y);

// Why `camera` cannot be used (wrong number of parameters, non-finite, focal length <= 0, zero or
// absurd size), or an empty string.
std::string FindFault(const Camera& camera);

// Pixel of a point in camera coordinates; nullopt if the point is not in front (z <= 0) or the
// result is not finite.
std::optional<Eigen::Vector2d> Project(const Camera& camera, const Eigen::Vector3d& point_in_cam);

// Ray (x/z, y/z) of a pixel: the inverse of Project to 1e-10 px wherever the distortion is
// invertible around the pixel; nullopt where the iteration does not converge.
std::optional<Eigen::Vector2d> Unproject(const Camera& camera, const Eigen::Vector2d& pixel);

// The same lens in another model of the pinhole family (SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL,
// RADIAL, OPENCV, FULL_OPENCV), its distortion zero; two focal lengths become their mean where the
// model has one. `camera` must be SIMPLE_PINHOLE or PINHOLE, else std::invalid_argument.
Camera PinholeInModel(const Camera& camera, CameraModel model);

// Intrinsics after the image is resized to width x height. Law: where a point projects to (x, y)
// before, it projects to (x, y) * new size / old size after. Where that needs two focal lengths, a
// model with one becomes the model that holds it as a special case: SIMPLE_PINHOLE becomes PINHOLE,
// SIMPLE_RADIAL and RADIAL become OPENCV, their fisheyes OPENCV_FISHEYE.
Camera Rescale(const Camera& camera, uint64_t width, uint64_t height);

}  // namespace vgtw
