// SPDX-License-Identifier: BSD-3-Clause
// The maps of a view of 3 x 2 network pixels.
#include "bridge/predictions.h"
#include "tests/fuzz/fuzzing.h"

#include <fstream>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  static const PredictionReader* reader = [] {
    ViewPrediction prediction;
    prediction.view.name = "a";
    prediction.view.camera = MakePinhole(60, 40, 50.0, 50.0);
    prediction.view.network_width = 3;
    prediction.view.network_height = 2;
    WritePrediction({"fuzz", "", {prediction}}, ScratchFolder() / "predictions", true);
    return new PredictionReader(ScratchFolder() / "predictions");
  }();
  std::ofstream(ScratchFolder() / "predictions/views/a.safetensors", std::ios::binary)
      << InputText(data, size);
  return OnlyErrors([&] { Require(FindFault(reader->Load(0)).empty()); });
}
