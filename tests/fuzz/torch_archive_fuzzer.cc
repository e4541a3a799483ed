// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint_torch.h"
#include "tests/fuzz/fuzzing.h"

#include <functional>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    const auto input = InputBytes(data, size);
    const TorchWeights weights = ParseTorchWeights(input, "fuzz");
    const auto lies_in = [](std::span<const std::byte> inner, std::span<const std::byte> outer) {
      const std::less_equal<const std::byte*> not_after;
      return not_after(outer.data(), inner.data()) &&
             not_after(inner.data() + inner.size(), outer.data() + outer.size());
    };
    size_t num_copied = 0;
    for (const auto& copy : weights.copies) num_copied += copy.size();
    Require(num_copied <= size);
    unsigned sum = 0;
    for (const auto& [name, tensor] : weights.tensors) {
      size_t num_bytes = SizeInBytes(tensor.type);
      for (const uint64_t dimension : tensor.shape) num_bytes *= dimension;
      Require(tensor.bytes.size() == num_bytes);
      bool has_place = lies_in(tensor.bytes, input);
      for (const auto& copy : weights.copies) has_place |= lies_in(tensor.bytes, copy);
      Require(has_place);
      for (const std::byte byte : tensor.bytes) sum += std::to_integer<unsigned>(byte);
    }
    volatile unsigned read = sum;  // every byte can be read
    static_cast<void>(read);
  });
}
