// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/predictions_json.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    const std::string text =
        FormatPredictionsIndex(ParsePredictionsIndex(InputText(data, size), "fuzz"));
    // What was accepted is written and read back without loss.
    Require(FormatPredictionsIndex(ParsePredictionsIndex(text, "fuzz")) == text);
  });
}
