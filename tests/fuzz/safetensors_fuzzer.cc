// SPDX-License-Identifier: BSD-3-Clause
#include "scene/safetensors.h"
#include "tests/fuzz/fuzzing.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    const SafetensorsContent content = ParseSafetensors(InputBytes(data, size), "fuzz");
    size_t num_bytes = 0;
    for (const auto& [name, tensor] : content.tensors) {
      num_bytes += tensor.bytes.size();
      Require(tensor.NumElements() * SizeInBytes(tensor.type) == tensor.bytes.size());
      const bool is_floating = tensor.type == TensorType::kF64 || tensor.type == TensorType::kF32 ||
                               tensor.type == TensorType::kF16 || tensor.type == TensorType::kBF16;
      if (is_floating) Require(ToFloats(tensor).size() == tensor.NumElements());
    }
    Require(num_bytes < size);
  });
}
