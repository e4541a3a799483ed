// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <string>

namespace vgtw {

// A pose of a set in which the order means something (time, lines of a file) and names are unique.
struct NamedPose {
  std::string name;
  Rigid3d cam_from_world;
};

}  // namespace vgtw
