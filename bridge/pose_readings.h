// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import.h"
#include "scene/named_pose.h"

#include <string>
#include <vector>

namespace vgtw {

// What a set of poses becomes if a mistake in their convention is mended.
struct PoseReading {
  // Of `vgtw import` and `vgtw evaluate pose`, which give these poses: "--invert_poses", ...; "" if
  // what was read under repairs is right without them.
  std::string options;
  std::vector<NamedPose> poses;
};

// Every combination of repairs, fewer mistakes first. It is not asked how the poses were stored:
// quaternions may have been misread in either order, in cam_from_world or world_from_cam, each with
// its own translation. `as_read` are the repairs under which the poses were read already.
std::vector<PoseReading> OtherReadings(const std::vector<NamedPose>& poses,
                                       const ConventionRepair& as_read = {});

}  // namespace vgtw
