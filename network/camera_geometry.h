// SPDX-License-Identifier: BSD-3-Clause
// From the networks' raw camera outputs to matrices. Internal to network/: needs LibTorch. Frames
// as in the official code: OpenCV axes, pixel centres at integers, the principal point in W/2, H/2.
#pragma once

#include <cstdint>

#include <ATen/core/Tensor.h>

namespace vgtw {

struct CameraMatrices {
  at::Tensor cam_from_world;  // [S, 3, 4]
  at::Tensor intrinsics;      // [S, 3, 3], pixels of the network's image
};

// VGGT's pose encodings [S, 9]: translation, quaternion xyzw of any length, vertical and horizontal
// field of view (rad) of an image of height x width pixels.
CameraMatrices DecodePoses(const at::Tensor& encodings, int64_t height, int64_t width);

// The inverse of DecodePoses, for cameras whose principal point is in the middle; unit quaternions
// with w >= 0.
at::Tensor EncodePoses(const CameraMatrices& cameras, int64_t height, int64_t width);

// Inverses of transforms [S, 3, 4].
at::Tensor InvertPoses(const at::Tensor& poses);

// Rotations [S, 3, 3] for quaternions [S, 4], xyzw, of any length but 0.
at::Tensor RotationsFromQuaternions(const at::Tensor& quaternions_xyzw);

// Unit quaternions [S, 4], xyzw, w >= 0, of rotations [S, 3, 3].
at::Tensor QuaternionsFromRotations(const at::Tensor& rotations);

// The rotations [S, 3, 3] nearest to matrices whose rows are first scaled to length 1 and which are
// then transposed, as pi3 does with its raw output [S, 9].
at::Tensor NearestRotations(const at::Tensor& raw);

// Points [S, H, W, 3] in the frame of the world from z-depths [S, H, W].
at::Tensor Unproject(const at::Tensor& depth, const CameraMatrices& cameras);

}  // namespace vgtw
