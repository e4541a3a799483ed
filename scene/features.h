// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// COLMAP's scale (pixels) of a row of keypoints, which has `cols` values; 0 with 2 columns.
float KeypointScale(const float* row, uint32_t cols);

// float32 [rows, cols], cols 2 (x y), 4 (x y scale orientation_rad) or 6 (x y a11 a12 a21 a22);
// x, y in original pixels, first centre (0.5, 0.5).
struct Keypoints {
  uint32_t rows = 0;
  uint32_t cols = 0;
  std::vector<float> data;

  float x(size_t row) const { return data[row * cols]; }
  float y(size_t row) const { return data[row * cols + 1]; }
  float Scale(size_t row) const { return KeypointScale(data.data() + row * cols, cols); }
};

// Bytes [rows, cols]; cols is bytes per row (128 for SIFT). type: COLMAP 4's, -1 = undefined,
// 0 = SIFT, 1 and 2 = ALIKED (float32).
struct Descriptors {
  uint32_t rows = 0;
  uint32_t cols = 0;
  int type = 0;
  std::vector<uint8_t> data;
};

// Of one image; row i of both is the same feature.
struct Features {
  Keypoints keypoints;
  Descriptors descriptors;
};

// (point2D_idx in image 1, point2D_idx in image 2); image 1 is the one that was named first.
using FeatureMatches = std::vector<std::array<uint32_t, 2>>;

// COLMAP's configurations that are made here. Others: 0 undefined, 6 planar or panoramic,
// 7 watermark, 8 multiple, 9 calibrated rig (>= 3.12).
inline constexpr int kTwoViewDegenerate = 1;
inline constexpr int kTwoViewCalibrated = 2;
inline constexpr int kTwoViewUncalibrated = 3;
inline constexpr int kTwoViewPlanar = 4;
inline constexpr int kTwoViewPanoramic = 5;

// How image 2 relates to image 1:  x2^T F x1 = 0,  x2 ~ H x1  (pixels), E likewise for rays.
struct TwoViewGeometry {
  int config = 0;
  FeatureMatches inlier_matches = {};
  std::optional<Eigen::Matrix3d> F = {};
  std::optional<Eigen::Matrix3d> E = {};
  std::optional<Eigen::Matrix3d> H = {};
  std::optional<Rigid3d> cam2_from_cam1 = {};
};

}  // namespace vgtw
