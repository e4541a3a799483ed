// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// One line of a trajectory in the format of the TUM RGB-D benchmark:
//   timestamp tx ty tz qx qy qz qw     world_from_cam; '#' begins a comment line
// The first column may also be an image name (then it may hold spaces).
struct TumPose {
  std::string label;  // the first column as written
  Rigid3d world_from_cam;
};

// Throws Error naming the line if a line has fewer than 8 columns, a number is not finite, or the
// quaternion is not of unit length within 1 %. `origin` names the file in messages.
std::vector<TumPose> ParseTumTrajectory(std::string_view text, const std::string& origin);

}  // namespace vgtw
