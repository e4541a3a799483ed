// SPDX-License-Identifier: BSD-3-Clause
#include "scene/camera.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace vgtw {
namespace {

constexpr std::array<CameraModelInfo, kNumCameraModels> kModels = {{
    {CameraModel::kSimplePinhole, "SIMPLE_PINHOLE", 3, 1},
    {CameraModel::kPinhole, "PINHOLE", 4, 2},
    {CameraModel::kSimpleRadial, "SIMPLE_RADIAL", 4, 1},
    {CameraModel::kRadial, "RADIAL", 5, 1},
    {CameraModel::kOpenCV, "OPENCV", 8, 2},
    {CameraModel::kOpenCVFisheye, "OPENCV_FISHEYE", 8, 2},
    {CameraModel::kFullOpenCV, "FULL_OPENCV", 12, 2},
    {CameraModel::kFOV, "FOV", 5, 2},
    {CameraModel::kSimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4, 1},
    {CameraModel::kRadialFisheye, "RADIAL_FISHEYE", 5, 1},
    {CameraModel::kThinPrismFisheye, "THIN_PRISM_FISHEYE", 12, 2},
}};

const CameraModelInfo& CheckedInfo(const Camera& camera) {
  const CameraModelInfo& info = GetCameraModelInfo(camera.model);
  VGTW_CHECK(camera.params.size() == static_cast<size_t>(info.num_params),
             "wrong number of camera parameters");
  return info;
}

// The model with two focal lengths that holds `model` as a special case.
CameraModel TwoFocalLengthsModel(CameraModel model) {
  switch (model) {
    case CameraModel::kSimplePinhole:
      return CameraModel::kPinhole;
    case CameraModel::kSimpleRadial:
    case CameraModel::kRadial:
      return CameraModel::kOpenCV;
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
      return CameraModel::kOpenCVFisheye;
    default:
      return model;
  }
}

// The same projection with separate focal lengths. Radial coefficients come first in both models,
// and the coefficients that the richer model adds are zero.
Camera SplitFocalLength(const Camera& camera) {
  const double f = camera.FocalLengthX();
  const Eigen::Vector2d principal_point = camera.PrincipalPoint();
  Camera split = camera;
  split.model = TwoFocalLengthsModel(camera.model);
  split.params = {f, f, principal_point.x(), principal_point.y()};
  split.params.insert(split.params.end(),
                      camera.params.begin() + static_cast<int>(camera.FirstExtraParamIdx()),
                      camera.params.end());
  split.params.resize(static_cast<size_t>(GetCameraModelInfo(split.model).num_params), 0.0);
  return split;
}

}  // namespace

const CameraModelInfo& GetCameraModelInfo(CameraModel model) {
  const int model_id = static_cast<int>(model);
  VGTW_CHECK(model_id >= 0 && model_id < kNumCameraModels, "unknown camera model");
  return kModels[static_cast<size_t>(model_id)];
}

std::optional<CameraModel> FindCameraModel(std::string_view name) {
  const auto found = std::find_if(
      kModels.begin(), kModels.end(), [&](const auto& row) { return row.name == name; });
  if (found == kModels.end()) return std::nullopt;
  return found->model;
}

std::optional<CameraModel> FindCameraModel(int model_id) {
  if (model_id < 0 || model_id >= kNumCameraModels) return std::nullopt;
  return static_cast<CameraModel>(model_id);
}

double Camera::FocalLengthX() const {
  CheckedInfo(*this);
  return params[0];
}

double Camera::FocalLengthY() const { return params[CheckedInfo(*this).num_focal_lengths - 1]; }

Eigen::Vector2d Camera::PrincipalPoint() const {
  const auto idx = static_cast<size_t>(CheckedInfo(*this).num_focal_lengths);
  return {params[idx], params[idx + 1]};
}

void Camera::SetFocalLength(double focal_length_x, double focal_length_y) {
  if (CheckedInfo(*this).num_focal_lengths == 1) {
    params[0] = 0.5 * (focal_length_x + focal_length_y);
  } else {
    params[0] = focal_length_x;
    params[1] = focal_length_y;
  }
}

void Camera::SetPrincipalPoint(const Eigen::Vector2d& principal_point) {
  const auto idx = static_cast<size_t>(CheckedInfo(*this).num_focal_lengths);
  params[idx] = principal_point.x();
  params[idx + 1] = principal_point.y();
}

size_t Camera::FirstExtraParamIdx() const {
  return static_cast<size_t>(GetCameraModelInfo(model).num_focal_lengths) + 2;
}

Camera MakePinhole(uint64_t width, uint64_t height, double focal_length_x, double focal_length_y) {
  Camera camera;
  camera.model = CameraModel::kPinhole;
  camera.width = width;
  camera.height = height;
  camera.params = {focal_length_x,
                   focal_length_y,
                   0.5 * static_cast<double>(width),
                   0.5 * static_cast<double>(height)};
  return camera;
}

std::string FindFault(const Camera& camera) {
  constexpr uint64_t kMaxSize = uint64_t{1} << 20;
  const int model_id = static_cast<int>(camera.model);
  if (!FindCameraModel(model_id)) return "unknown camera model " + std::to_string(model_id);
  const CameraModelInfo& info = GetCameraModelInfo(camera.model);
  if (camera.params.size() != static_cast<size_t>(info.num_params)) {
    return std::string(info.name) + " has " + std::to_string(camera.params.size()) +
           " parameters, must have " + std::to_string(info.num_params);
  }
  if (camera.width == 0 || camera.height == 0 || camera.width > kMaxSize ||
      camera.height > kMaxSize) {
    return "image size " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
           ", must be between 1 and " + std::to_string(kMaxSize);
  }
  for (const double param : camera.params) {
    if (!std::isfinite(param)) return "a parameter is not finite";
  }
  if (camera.FocalLengthX() <= 0.0 || camera.FocalLengthY() <= 0.0) {
    return "focal length is not positive";
  }
  return {};
}

Camera PinholeInModel(const Camera& camera, CameraModel model) {
  VGTW_CHECK(camera.model == CameraModel::kSimplePinhole || camera.model == CameraModel::kPinhole,
             "the camera has a distortion");
  // Beyond these, zero coefficients are another projection than the pinhole's.
  VGTW_CHECK(model <= CameraModel::kOpenCV || model == CameraModel::kFullOpenCV,
             "not a model of the pinhole family");
  Camera converted = camera;
  converted.model = model;
  converted.params.assign(static_cast<size_t>(GetCameraModelInfo(model).num_params), 0.0);
  converted.SetFocalLength(camera.FocalLengthX(), camera.FocalLengthY());
  converted.SetPrincipalPoint(camera.PrincipalPoint());
  return converted;
}

Camera Rescale(const Camera& camera, uint64_t width, uint64_t height) {
  VGTW_CHECK(camera.width > 0 && camera.height > 0, "the camera has no size");
  VGTW_CHECK(width > 0 && height > 0, "the new size is empty");
  const double scale_x = static_cast<double>(width) / static_cast<double>(camera.width);
  const double scale_y = static_cast<double>(height) / static_cast<double>(camera.height);
  // Cross products are exact in integers where quotients are not.
  const bool isotropic = width * camera.height == height * camera.width;
  Camera scaled = isotropic || GetCameraModelInfo(camera.model).num_focal_lengths == 2
                      ? camera
                      : SplitFocalLength(camera);
  scaled.SetFocalLength(scale_x * camera.FocalLengthX(), scale_y * camera.FocalLengthY());
  scaled.SetPrincipalPoint(camera.PrincipalPoint().cwiseProduct(Eigen::Vector2d(scale_x, scale_y)));
  scaled.width = width;
  scaled.height = height;
  return scaled;
}

}  // namespace vgtw
