// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/files.h"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// Element types of .safetensors files that this project reads and writes; BF16 is the upper half of
// an F32.
enum class TensorType { kF64, kI64, kF32, kI32, kF16, kBF16, kU8, kBool };
size_t SizeInBytes(TensorType type);
std::string_view TensorTypeName(TensorType type);  // as in files: "F32"

// A row-major array of a file, not owned. `bytes` is little-endian and of any alignment.
// Law: bytes.size() = product(shape) * SizeInBytes(type); the shape [] is one element.
struct StoredTensor {
  TensorType type = TensorType::kF32;
  std::vector<uint64_t> shape;
  std::span<const std::byte> bytes;

  size_t NumElements() const { return bytes.size() / SizeInBytes(type); }
};
using StoredTensors = std::map<std::string, StoredTensor, std::less<>>;

struct SafetensorsContent {
  StoredTensors tensors;
  std::map<std::string, std::string> metadata;
};

// The tensors of a file's bytes: u64 length of the header, the header (JSON), the data. Spans point
// into `bytes`; `path` is for messages. Throws Error if the header is longer than the file or
// 16 MiB, is not the JSON of the format, names an unknown type, or if the tensors do not cover the
// data exactly once (the format forbids holes and overlaps).
SafetensorsContent ParseSafetensors(std::span<const std::byte> bytes,
                                    const std::filesystem::path& path);

// A file mapped into memory; nothing but the header is read until a tensor is touched.
class SafetensorsFile {
 public:
  explicit SafetensorsFile(const std::filesystem::path& path)
      : file_(path), content_(ParseSafetensors(file_.bytes(), path)) {}

  const StoredTensors& tensors() const { return content_.tensors; }
  const std::map<std::string, std::string>& metadata() const { return content_.metadata; }

 private:
  MappedFile file_;
  SafetensorsContent content_;
};

// Writes atomically. The data starts at a multiple of 8 bytes and larger elements come first, so
// that every tensor is aligned to its element. The same input gives the same bytes. Throws
// std::invalid_argument if a tensor breaks its law, a name is "__metadata__" or a name is not
// UTF-8; Error if the file cannot be written.
void WriteSafetensors(const std::filesystem::path& path,
                      const StoredTensors& tensors,
                      const std::map<std::string, std::string>& metadata = {});

// A tensor of a file to be written, before its bytes are there.
struct TensorLayout {
  TensorType type = TensorType::kF32;
  std::vector<uint64_t> shape;
};
using TensorLayouts = std::map<std::string, TensorLayout, std::less<>>;

using ByteSink = std::function<void(std::span<const std::byte> bytes)>;
// Gives the bytes of tensor `name` to `sink`, in any number of pieces.
using TensorSource = std::function<void(const std::string& name, const ByteSink& sink)>;

// WriteSafetensors without holding the tensors: `source` is asked once for every tensor, in the
// order of the data. Also throws std::invalid_argument if `source` gives another number of bytes
// than the layout needs; what `source` throws passes through, and no file is left.
void StreamSafetensors(const std::filesystem::path& path,
                       const TensorLayouts& layouts,
                       const TensorSource& source,
                       const std::map<std::string, std::string>& metadata = {});

// Values of an F64, F32, F16 or BF16 tensor, F64 rounded; std::invalid_argument for another type.
std::vector<float> ToFloats(const StoredTensor& tensor);

}  // namespace vgtw
