// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Trajectories as text, a pose a line; '#' begins a comment line.
enum class TrajectoryFormat {
  kTum,   // TUM RGB-D:  timestamp tx ty tz qx qy qz qw     world_from_cam
  kKitti  // KITTI odometry:  the 3x4 matrix [R|t] of world_from_cam, row by row
};

// By the first line that holds a pose; nullopt if it is of neither format. Sixteen numbers are a
// 4x4 matrix, although the last seven may look like a pose of kTum.
std::optional<TrajectoryFormat> FindTrajectoryFormat(std::string_view text);

struct TumPose {
  std::string label;  // the first column as written: a timestamp or an image name with spaces
  Rigid3d world_from_cam;
};

// Throws Error naming the line if a line has fewer than 8 columns, a number is not finite, or the
// quaternion is not of unit length within 1 %. `origin` names the file in messages.
std::vector<TumPose> ParseTumTrajectory(std::string_view text, const std::string& origin);

// world_from_cam by line. Throws Error naming the line if it is not of 12 finite numbers or R is no
// rotation within 1 %.
std::vector<Rigid3d> ParseKittiTrajectory(std::string_view text, const std::string& origin);

// Matrices as text, one a line. Throws Error naming the line if it is not of `num_columns` finite
// numbers (at most 16).
std::vector<std::vector<double>> ParseNumberRows(std::string_view text,
                                                 size_t num_columns,
                                                 const std::string& origin);

// The number that a label is; nullopt if it is none.
std::optional<double> ParseTimestamp(std::string_view label);

}  // namespace vgtw
