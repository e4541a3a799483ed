// SPDX-License-Identifier: BSD-3-Clause
// The first byte chooses one of the five files, the rest is the file.
#include "bridge/colmap_model_text.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  if (size == 0) return 0;
  const auto file = InputText(data + 1, size - 1);
  return OnlyErrors([&] {
    Reconstruction model;
    if (data[0] == 'c') ParseCamerasText(file, "fuzz", model);
    if (data[0] == 'i') ParseImagesText(file, "fuzz", model);
    if (data[0] == 'p') ParsePoints3DText(file, "fuzz", model);
    if (data[0] == 'r') ParseRigsText(file, "fuzz", model);
    if (data[0] == 'f') ParseFramesText(file, "fuzz", model);
    FindFault(model);
  });
}
