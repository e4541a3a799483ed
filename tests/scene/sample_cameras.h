// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"

#include <vector>

namespace vgtw {

// One camera per model, 640 x 480, as distorted as real lenses of the kind are; every coefficient
// differs from the others, so that swapped ones are noticed. All are invertible on their image.
inline std::vector<Camera> SampleCameras() {
  const auto make = [](CameraModel model, std::vector<double> params) {
    Camera camera;
    camera.camera_id = static_cast<uint32_t>(model) + 1;
    camera.model = model;
    camera.width = 640;
    camera.height = 480;
    camera.params = std::move(params);
    return camera;
  };
  return {
      make(CameraModel::kSimplePinhole, {500, 322, 237}),
      make(CameraModel::kPinhole, {500, 510, 322, 237}),
      make(CameraModel::kSimpleRadial, {500, 322, 237, -0.2}),
      make(CameraModel::kRadial, {500, 322, 237, -0.25, 0.06}),
      make(CameraModel::kOpenCV, {500, 510, 322, 237, -0.25, 0.06, 0.002, -0.003}),
      make(CameraModel::kOpenCVFisheye, {260, 265, 322, 237, 0.05, -0.02, 0.004, -0.001}),
      make(CameraModel::kFullOpenCV,
           {500, 510, 322, 237, 0.3, 0.06, 0.002, -0.003, 0.01, 0.4, 0.1, 0.02}),
      make(CameraModel::kFOV, {400, 410, 322, 237, 0.9}),
      make(CameraModel::kSimpleRadialFisheye, {260, 322, 237, 0.05}),
      make(CameraModel::kRadialFisheye, {260, 322, 237, 0.05, -0.02}),
      make(CameraModel::kThinPrismFisheye,
           {260, 265, 322, 237, 0.05, -0.02, 0.002, -0.003, 0.004, -0.001, 0.001, -0.002}),
  };
}

}  // namespace vgtw
