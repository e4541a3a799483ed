// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/transforms_json.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    const auto frames = ParseTransformsJson(InputText(data, size), "fuzz");
    Require(!frames.empty());
    for (const TransformsFrame& frame : frames) Require(FindFault(frame.world_from_cam).empty());
  });
}
