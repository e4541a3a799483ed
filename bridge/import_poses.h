// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bridge/import.h"
#include "scene/rigid3d.h"

#include <string>

namespace vgtw {

// How a format writes rotations.
enum class RotationForm { kMatrix, kQuaternionWxyz, kQuaternionXyzw };

// A pose exactly as a file tells it, read by the rules of its format.
struct FilePose {
  Rigid3d transform;
  bool is_world_from_cam = false;  // what the format prescribes
  RotationForm form = RotationForm::kMatrix;
};

// cam_from_world under the repairs, in this order: the four numbers of the quaternion are read in
// the other order; the transform is taken for its opposite; the camera's axes are turned from
// (x right, y up, z backwards) to ours. swap_quaternion_order does nothing to matrices.
Rigid3d CamFromWorld(const FilePose& pose, const ConventionRepair& repair);

// "--invert_poses --opengl_axes": the options that ask for these repairs, or "".
std::string OptionsText(const ConventionRepair& repair);

}  // namespace vgtw
