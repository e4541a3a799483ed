// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "network/pickle.h"
#include "scene/safetensors.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace vgtw {

// A tensor as a pickle of torch describes it: a view of a storage whose bytes lie elsewhere.
// Element (i, j, ...) is number offset + i strides[0] + j strides[1] + ... of the storage.
// Law: every element lies in the storage; the size in bytes of tensor and storage fits 63 bits.
struct PickledTensor {
  std::string name;         // keys of the dicts around it, joined by dots: "block.0.weight"
  std::string storage_key;  // the storage is the entry "data/<key>" of the archive
  TensorType type = TensorType::kF32;
  uint64_t num_storage_elements = 0;
  uint64_t offset = 0;
  std::vector<uint64_t> shape;
  std::vector<uint64_t> strides;  // as many as dimensions
};

// The keys under which training scripts keep the weights: "model", "state_dict", ...
const std::vector<std::string>& WeightKeys();

// The weights in a pickle whose root is a dict, ordered as there. If only dicts lie in the root and
// one of WeightKeys() leads to tensors, they are those below it and what lies beside (optimizer,
// counters, averaged copies) is left out; else all that are reached by keys that are strings.
// Throws Error if two weight keys lead to tensors, a key is there twice or unprintable, dicts are
// nested more than 16 deep, or a tensor breaks the law above; `path` is for messages.
std::vector<PickledTensor> PickledTensors(const Pickle& pickle, const std::filesystem::path& path);

}  // namespace vgtw
