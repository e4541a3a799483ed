// SPDX-License-Identifier: BSD-3-Clause
#include "network/pickle.h"
#include "network/pickle_tensors.h"
#include "tests/fuzz/fuzzing.h"

#include <algorithm>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  return OnlyErrors([&] {
    const Pickle pickle(InputBytes(data, size), "fuzz");
    for (const PickledTensor& tensor : PickledTensors(pickle, "fuzz")) {
      Require(tensor.shape.size() == tensor.strides.size());
      if (std::find(tensor.shape.begin(), tensor.shape.end(), 0u) != tensor.shape.end()) continue;
      // In 128 bits nothing overflows: the last element lies in the storage.
      unsigned __int128 last = tensor.offset;
      for (size_t i = 0; i < tensor.shape.size(); ++i) {
        last += static_cast<unsigned __int128>(tensor.shape[i] - 1) * tensor.strides[i];
      }
      Require(last < tensor.num_storage_elements);
    }
  });
}
