// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/trajectory_text.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    for (const TumPose& pose : ParseTumTrajectory(InputText(data, size), "fuzz")) {
      Require(FindFault(pose.world_from_cam).empty());
    }
  });
}
