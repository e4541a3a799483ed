// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/import_arrays.h"
#include "bridge/npz.h"
#include "tests/fuzz/fuzzing.h"

// Every array alone, then all of them as the views of a network.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace vgtw;
  std::unique_ptr<ArrayStore> store;
  OnlyErrors([&] { store = OpenArchive(std::string(InputText(data, size)), "fuzz"); });
  if (store == nullptr) return 0;
  for (const std::string& key : store->keys()) {
    OnlyErrors([&] {
      NpyReader reader = store->Open(key);
      uint64_t num_left = 1;
      for (const uint64_t dimension : reader.shape()) num_left *= dimension;
      std::vector<float> values(std::min<uint64_t>(num_left, 1 << 16));
      reader.Read(std::span(values));
    });
  }
  return OnlyErrors([&] {
    ArrayViews views(*store);
    for (size_t i = 0; i < std::min<size_t>(views.num_views(), 4); ++i) {
      const ViewArrays view = views.Next();
      for (const float depth : view.depth.data()) Require(!(depth <= 0.0f));
      for (const float value : view.distractor.data()) Require(!(value < 0.0f || value > 1.0f));
    }
  });
}
