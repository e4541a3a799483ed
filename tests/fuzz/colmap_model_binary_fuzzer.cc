// SPDX-License-Identifier: BSD-3-Clause
// The first byte chooses one of the five files, the rest is the file.
#include "bridge/colmap_model_binary.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  if (size == 0) return 0;
  const auto file = InputBytes(data + 1, size - 1);
  return OnlyErrors([&] {
    Reconstruction model;
    if (data[0] == 'c') ParseCamerasBinary(file, "fuzz", model);
    if (data[0] == 'i') ParseImagesBinary(file, "fuzz", model);
    if (data[0] == 'p') ParsePoints3DBinary(file, "fuzz", model);
    if (data[0] == 'r') ParseRigsBinary(file, "fuzz", model);
    if (data[0] == 'f') ParseFramesBinary(file, "fuzz", model);
    FindFault(model);
  });
}
