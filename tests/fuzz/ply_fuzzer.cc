// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/point_cloud.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    for (const ColoredPoint& point : ParsePly(InputBytes(data, size), "fuzz")) {
      Require(point.xyz.allFinite());
    }
  });
}
