// SPDX-License-Identifier: BSD-3-Clause
// First byte: p = protocol.json, s = split.json of a scene of 6 photos; then that file.
#include "bridge/dataset_scenes.h"
#include "bridge/protocol.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  if (size == 0) return 0;
  const std::string_view text = InputText(data + 1, size - 1);
  return OnlyErrors([&] {
    if (data[0] == 's') {
      constexpr size_t kNumImages = 6;
      const SplitIndices split = ParseSplitJson(text, kNumImages, "fuzz");
      Require(split.clean.size() + split.clutter.size() <= kNumImages);
      for (const size_t idx : split.clean) Require(idx < kNumImages);
      return;
    }
    const std::string written = FormatProtocol(ParseProtocol(text, "fuzz"));
    Require(FormatProtocol(ParseProtocol(written, "fuzz")) == written);
  });
}
