// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"

#include <cmath>

namespace vgtw {

// COLMAP's projections for any scalar, so that Ceres can differentiate them. Law: for doubles and
// points in front of the camera they equal scene/camera.h's Project.

// The number of parameters of a model, at compile time: the size of Ceres' block.
template <CameraModel kModel>
constexpr int NumCameraParams() {
  constexpr int kNumParams[kNumCameraModels] = {3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12};
  return kNumParams[static_cast<int>(kModel)];
}

template <CameraModel kModel>
constexpr int NumFocalLengths() {
  return kModel == CameraModel::kSimplePinhole || kModel == CameraModel::kSimpleRadial ||
                 kModel == CameraModel::kRadial || kModel == CameraModel::kSimpleRadialFisheye ||
                 kModel == CameraModel::kRadialFisheye
             ? 1
             : 2;
}

template <CameraModel kModel>
constexpr bool IsFisheye() {
  return kModel == CameraModel::kOpenCVFisheye || kModel == CameraModel::kSimpleRadialFisheye ||
         kModel == CameraModel::kRadialFisheye || kModel == CameraModel::kThinPrismFisheye;
}

// atan(r) / r as a function of r^2: smooth at 0, where the quotient is not differentiable.
template <typename T>
T AtanRatio(const T& r2) {
  using std::atan;
  using std::sqrt;
  // The next term of the series, r^6 / 7, is below 1e-18 here.
  if (r2 < T(1e-6)) return T(1.0) + r2 * (T(-1.0 / 3.0) + r2 * T(1.0 / 5.0));
  const T r = sqrt(r2);
  return atan(r) / r;
}

// Factor of Devernay and Faugeras' field-of-view model, "Straight lines have to be straight", 2001:
// atan(2 r tan(omega / 2)) / (r omega).
template <typename T>
T FovRatio(const T& omega, const T& r2) {
  using std::tan;
  // For small omega  2 tan(omega / 2) / omega  is 1 + omega^2 / 12 up to omega^4 / 120.
  const T tan_ratio = omega * omega < T(1e-6) ? T(1.0) + omega * omega / T(12.0)
                                              : T(2.0) * tan(omega / T(2.0)) / omega;
  const T stretch = tan_ratio * omega;
  return tan_ratio * AtanRatio(stretch * stretch * r2);
}

// (u, v) = (x/z, y/z) to distorted coordinates; `k` are the parameters behind the principal point.
template <CameraModel kModel, typename T>
void Distort(const T* k, T u, T v, T* distorted_u, T* distorted_v) {
  if constexpr (IsFisheye<kModel>()) {
    const T ratio = AtanRatio(u * u + v * v);
    u = u * ratio;
    v = v * ratio;
  }
  const T r2 = u * u + v * v;
  T radial(1.0);
  T tangential_u(0.0);
  T tangential_v(0.0);
  if constexpr (kModel == CameraModel::kSimpleRadial ||
                kModel == CameraModel::kSimpleRadialFisheye) {
    radial += k[0] * r2;
  } else if constexpr (kModel == CameraModel::kRadial || kModel == CameraModel::kRadialFisheye) {
    radial += r2 * (k[0] + r2 * k[1]);
  } else if constexpr (kModel == CameraModel::kOpenCVFisheye) {
    radial += r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])));
  } else if constexpr (kModel == CameraModel::kFOV) {
    radial = FovRatio(k[0], r2);
  } else if constexpr (kModel == CameraModel::kOpenCV || kModel == CameraModel::kFullOpenCV ||
                       kModel == CameraModel::kThinPrismFisheye) {
    tangential_u = T(2.0) * k[2] * u * v + k[3] * (r2 + T(2.0) * u * u);
    tangential_v = T(2.0) * k[3] * u * v + k[2] * (r2 + T(2.0) * v * v);
    radial += r2 * (k[0] + r2 * k[1]);
    if constexpr (kModel == CameraModel::kFullOpenCV) {
      radial += r2 * r2 * r2 * k[4];
      radial /= T(1.0) + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    } else if constexpr (kModel == CameraModel::kThinPrismFisheye) {
      radial += r2 * r2 * r2 * (k[4] + r2 * k[5]);
      tangential_u += k[6] * r2;
      tangential_v += k[7] * r2;
    }
  }
  *distorted_u = u * radial + tangential_u;
  *distorted_v = v * radial + tangential_v;
}

// Pixel of (u, v) = (x/z, y/z).
template <CameraModel kModel, typename T>
void ProjectNormalized(const T* params, const T& u, const T& v, T* pixel) {
  constexpr int kNumFocal = NumFocalLengths<kModel>();
  T distorted_u, distorted_v;
  Distort<kModel>(params + kNumFocal + 2, u, v, &distorted_u, &distorted_v);
  pixel[0] = params[0] * distorted_u + params[kNumFocal];
  pixel[1] = params[kNumFocal - 1] * distorted_v + params[kNumFocal + 1];
}

}  // namespace vgtw
