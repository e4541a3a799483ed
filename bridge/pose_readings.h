// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/named_pose.h"

#include <string>
#include <vector>

namespace vgtw {

// What a set of poses becomes if a mistake in their convention is mended.
struct PoseReading {
  std::string options;  // of `vgtw import` that mend it: "--invert_poses --opengl_axes"
  std::vector<NamedPose> poses;
};

// Every combination of repairs, fewer mistakes first. It is not asked how the poses were stored:
// quaternions may have been misread in either order, in cam_from_world or world_from_cam, each with
// its own translation.
std::vector<PoseReading> OtherReadings(const std::vector<NamedPose>& poses);

}  // namespace vgtw
