// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/safetensors.h"

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

namespace vgtw {

struct TorchWeights {
  StoredTensors tensors;
  std::vector<std::vector<std::byte>> copies;  // row-major, of tensors that the file strides
};

// The weights in a file of torch.save, by the names and rules of network/pickle_tensors.h. Spans
// point into `bytes` or `copies`. Throws Error as ParseTorchArchive, Pickle and PickledTensors do,
// if a storage is missing or of another size than the pickle says, if a name is there twice, and if
// the copies would need more bytes than the file has; `path` is for messages.
TorchWeights ParseTorchWeights(std::span<const std::byte> bytes, const std::filesystem::path& path);

}  // namespace vgtw
