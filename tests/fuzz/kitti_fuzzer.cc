// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/trajectory_text.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  FindTrajectoryFormat(InputText(data, size));
  return OnlyErrors([&] {
    for (const Rigid3d& world_from_cam : ParseKittiTrajectory(InputText(data, size), "fuzz")) {
      Require(FindFault(world_from_cam).empty());
    }
  });
}
