// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/npy.h"
#include "tests/fuzz/fuzzing.h"

#include <cstring>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  auto left = InputBytes(data, size);
  const auto source = [&](std::span<std::byte> wanted) {
    const size_t count = std::min(wanted.size(), left.size());
    if (count > 0) std::memcpy(wanted.data(), left.data(), count);
    left = left.subspan(count);
    return count;
  };
  return OnlyErrors([&] {
    NpyReader reader(source, size, "fuzz");
    uint64_t num_left = 1;
    for (const uint64_t dimension : reader.shape()) num_left *= dimension;
    std::vector<double> values;
    while (num_left > 0) {
      values.resize(std::min<uint64_t>(num_left, 100));
      reader.Read(std::span(values));
      num_left -= values.size();
    }
  });
}
