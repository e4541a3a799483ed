// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint_torch.h"

#include "network/pickle_tensors.h"
#include "network/torch_archive.h"
#include "scene/error.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

namespace vgtw {
namespace {

constexpr std::string_view kDamaged = "the file is truncated or damaged: copy or download it again";

bool IsEmpty(const PickledTensor& tensor) {
  return std::find(tensor.shape.begin(), tensor.shape.end(), 0u) != tensor.shape.end();
}

// Cannot overflow: the law of PickledTensor.
uint64_t NumBytes(const PickledTensor& tensor) {
  if (IsEmpty(tensor)) return 0;
  uint64_t num_bytes = SizeInBytes(tensor.type);
  for (const uint64_t dimension : tensor.shape) num_bytes *= dimension;
  return num_bytes;
}

bool IsRowMajor(const PickledTensor& tensor) {
  uint64_t stride = 1;
  for (size_t i = tensor.shape.size(); i-- > 0;) {
    if (tensor.shape[i] == 1) continue;
    if (tensor.strides[i] != stride) return false;
    stride *= tensor.shape[i];
  }
  return true;
}

std::vector<std::byte> CopyRowMajor(const PickledTensor& tensor,
                                    std::span<const std::byte> storage) {
  const size_t size = SizeInBytes(tensor.type);
  const size_t num_dimensions = tensor.shape.size();
  std::vector<std::byte> copy(NumBytes(tensor));
  std::vector<uint64_t> index(num_dimensions, 0);
  uint64_t element = tensor.offset;
  for (size_t position = 0; position < copy.size(); position += size) {
    std::memcpy(copy.data() + position, storage.data() + element * size, size);
    for (size_t i = num_dimensions; i-- > 0;) {
      element += tensor.strides[i];
      if (++index[i] < tensor.shape[i]) break;
      element -= tensor.strides[i] * tensor.shape[i];
      index[i] = 0;
    }
  }
  return copy;
}

std::span<const std::byte> StorageOf(const PickledTensor& tensor,
                                     const TorchArchive& archive,
                                     const std::filesystem::path& path) {
  const std::string who = "tensor '" + Printable(tensor.name) + "' ";
  const auto found = archive.storages.find(tensor.storage_key);
  if (found == archive.storages.end()) {
    Fail(path,
         who + "lies in data/" + Printable(tensor.storage_key) + ", which is not there",
         "an entry of the archive for every storage",
         kDamaged);
  }
  const uint64_t num_bytes = tensor.num_storage_elements * SizeInBytes(tensor.type);
  if (found->second.size() != num_bytes) {
    Fail(path,
         who + "lies in a storage of " + std::to_string(found->second.size()) + " bytes",
         "the " + std::to_string(num_bytes) + " that data.pkl announces",
         kDamaged);
  }
  return found->second;
}

}  // namespace

TorchWeights ParseTorchWeights(std::span<const std::byte> bytes,
                               const std::filesystem::path& path) {
  const TorchArchive archive = ParseTorchArchive(bytes, path);
  const Pickle pickle(archive.pickle, path);
  TorchWeights weights;
  uint64_t num_copied = 0;
  for (const PickledTensor& tensor : PickledTensors(pickle, path)) {
    const auto storage = StorageOf(tensor, archive, path);
    StoredTensor stored = {tensor.type, tensor.shape, storage.first(0)};
    const uint64_t num_bytes = NumBytes(tensor);
    if (num_bytes > 0 && IsRowMajor(tensor)) {
      stored.bytes = storage.subspan(tensor.offset * SizeInBytes(tensor.type), num_bytes);
    } else if (num_bytes > 0) {
      if (num_bytes > bytes.size() - num_copied) {
        Fail(path,
             "tensor '" + Printable(tensor.name) + "' repeats its storage to " +
                 std::to_string(num_bytes) + " bytes",
             "views that together need no more than the file has",
             "save contiguous tensors: torch.save({k: v.clone() for k, v in ...}, path)");
      }
      num_copied += num_bytes;
      weights.copies.push_back(CopyRowMajor(tensor, storage));
      stored.bytes = weights.copies.back();
    }
    if (!weights.tensors.emplace(tensor.name, std::move(stored)).second) {
      Fail(path, "has the tensor '" + Printable(tensor.name) + "' twice", "once", kDamaged);
    }
  }
  return weights;
}

}  // namespace vgtw
