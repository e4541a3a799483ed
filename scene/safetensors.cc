// SPDX-License-Identifier: BSD-3-Clause
#include "scene/safetensors.h"

#include "scene/error.h"
#include "scene/float16.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include <nlohmann/json.hpp>

namespace vgtw {
namespace {

using Json = nlohmann::json;

static_assert(std::endian::native == std::endian::little, "files are little-endian");

constexpr size_t kLengthBytes = 8;
constexpr size_t kMaxHeaderBytes = size_t{16} << 20;
constexpr char kMetadataKey[] = "__metadata__";

struct TypeInfo {
  TensorType type;
  std::string_view name;
  size_t size;
};
constexpr std::array<TypeInfo, 8> kTypes = {{
    {TensorType::kF64, "F64", 8},
    {TensorType::kI64, "I64", 8},
    {TensorType::kF32, "F32", 4},
    {TensorType::kI32, "I32", 4},
    {TensorType::kF16, "F16", 2},
    {TensorType::kBF16, "BF16", 2},
    {TensorType::kU8, "U8", 1},
    {TensorType::kBool, "BOOL", 1},
}};

const TypeInfo& Info(TensorType type) { return kTypes[static_cast<size_t>(type)]; }

// product(shape) * element_size, nullopt if that does not fit into 64 bits.
std::optional<uint64_t> NumBytes(const std::vector<uint64_t>& shape, size_t element_size) {
  // With a zero in it the tensor is empty, however large the other dimensions are.
  if (std::find(shape.begin(), shape.end(), 0) != shape.end()) return 0;
  uint64_t num_bytes = element_size;
  for (const uint64_t dimension : shape) {
    if (num_bytes > std::numeric_limits<uint64_t>::max() / dimension) return std::nullopt;
    num_bytes *= dimension;
  }
  return num_bytes;
}

std::optional<std::vector<uint64_t>> ReadUnsignedArray(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_array()) return std::nullopt;
  std::vector<uint64_t> values;
  for (const Json& value : *found) {
    if (!value.is_number_unsigned()) return std::nullopt;
    values.push_back(value.get<uint64_t>());
  }
  return values;
}

std::string_view HeaderText(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  if (bytes.size() < kLengthBytes) {
    Fail(path,
         "has " + std::to_string(bytes.size()) + " bytes",
         "a safetensors file (at least 8)",
         "copy or write the file again");
  }
  uint64_t length = 0;
  std::memcpy(&length, bytes.data(), kLengthBytes);
  if (length > bytes.size() - kLengthBytes || length > kMaxHeaderBytes) {
    Fail(path,
         "announces a header of " + std::to_string(length) + " bytes in a file of " +
             std::to_string(bytes.size()),
         "a complete safetensors file with a header of at most 16 MiB",
         "copy or write the file again");
  }
  return {reinterpret_cast<const char*>(bytes.data()) + kLengthBytes, length};
}

Json ParseHeader(std::string_view text, const std::filesystem::path& path) {
  try {
    Json header = Json::parse(text);
    if (header.is_object()) return header;
    Fail(path, std::string("has a header that is a JSON ") + header.type_name(), "an object");
  } catch (const Json::exception& exception) {
    Fail(path, "has a header with " + Printable(exception.what()), "JSON");
  }
}

StoredTensor ParseTensor(const std::string& name,
                         const Json& entry,
                         std::span<const std::byte> data,
                         const std::filesystem::path& path) {
  const std::string who = "tensor '" + Printable(name) + "' ";
  if (!entry.is_object()) Fail(path, who + "is a " + entry.type_name(), "an object");
  const auto type_name = entry.find("dtype");
  if (type_name == entry.end() || !type_name->is_string()) Fail(path, who + "has no dtype", "one");
  const auto type = std::find_if(kTypes.begin(), kTypes.end(), [&](const TypeInfo& info) {
    return info.name == type_name->get_ref<const std::string&>();
  });
  if (type == kTypes.end()) {
    Fail(path,
         who + "has dtype " + Printable(type_name->get_ref<const std::string&>()),
         "F64, I64, F32, I32, F16, BF16, U8 or BOOL");
  }
  auto shape = ReadUnsignedArray(entry, "shape");
  const auto offsets = ReadUnsignedArray(entry, "data_offsets");
  if (!shape || !offsets || offsets->size() != 2) {
    Fail(path, who + "lacks a shape or data_offsets", "arrays of whole numbers >= 0");
  }
  const uint64_t begin = (*offsets)[0];
  const uint64_t end = (*offsets)[1];
  if (begin > end || end > data.size()) {
    Fail(path,
         who + "lies at bytes " + std::to_string(begin) + " to " + std::to_string(end),
         "a place inside the " + std::to_string(data.size()) + " bytes of data",
         "the file is truncated or damaged: copy or write it again");
  }
  if (NumBytes(*shape, type->size) != end - begin) {
    Fail(path,
         who + "has " + std::to_string(end - begin) + " bytes",
         "the product of its shape times " + std::to_string(type->size));
  }
  return {type->type, *std::move(shape), data.subspan(begin, end - begin)};
}

std::map<std::string, std::string> ParseMetadata(const Json& entry,
                                                 const std::filesystem::path& path) {
  const auto is_string = [](const Json& value) { return value.is_string(); };
  if (!entry.is_object() || !std::all_of(entry.begin(), entry.end(), is_string)) {
    Fail(path, "has other things than strings in __metadata__", "an object of strings");
  }
  return entry.get<std::map<std::string, std::string>>();
}

void CheckCoverage(const StoredTensors& tensors,
                   std::span<const std::byte> data,
                   const std::filesystem::path& path) {
  std::vector<std::span<const std::byte>> spans;
  for (const auto& [name, tensor] : tensors) {
    if (!tensor.bytes.empty()) spans.push_back(tensor.bytes);
  }
  std::sort(
      spans.begin(), spans.end(), [](const auto& a, const auto& b) { return a.data() < b.data(); });
  size_t position = 0;
  bool covers = true;
  for (const auto& span : spans) {
    covers = span.data() == data.data() + position;
    if (!covers) break;
    position += span.size();
  }
  if (covers && position == data.size()) return;
  Fail(path,
       "has a hole or an overlap at byte " + std::to_string(position) + " of its data",
       "tensors that cover the data exactly once",
       "the file is damaged: copy or write it again");
}

// Tensors in the order of their data: larger elements first keeps all of them aligned.
std::vector<const TensorLayouts::value_type*> DataOrder(const TensorLayouts& layouts) {
  std::vector<const TensorLayouts::value_type*> order;
  for (const auto& named : layouts) order.push_back(&named);
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) {
    return SizeInBytes(a->second.type) > SizeInBytes(b->second.type);
  });
  return order;
}

// The JSON, padded to a multiple of 8 bytes.
std::string HeaderFor(const std::vector<const TensorLayouts::value_type*>& order,
                      const std::map<std::string, std::string>& metadata) {
  Json header = Json::object();
  if (!metadata.empty()) header[kMetadataKey] = metadata;
  uint64_t offset = 0;
  for (const auto* named : order) {
    const auto& [name, layout] = *named;
    VGTW_CHECK(name != kMetadataKey, "a tensor cannot have the metadata's name");
    const auto num_bytes = NumBytes(layout.shape, SizeInBytes(layout.type));
    VGTW_CHECK(num_bytes && *num_bytes <= std::numeric_limits<uint64_t>::max() - offset,
               "tensor " + name + " is absurdly large");
    header[name] = {{"dtype", TensorTypeName(layout.type)},
                    {"shape", layout.shape},
                    {"data_offsets", {offset, offset + *num_bytes}}};
    offset += *num_bytes;
  }
  std::string text;
  try {
    text = header.dump();
  } catch (const Json::exception& exception) {
    throw std::invalid_argument(std::string("tensor names must be UTF-8: ") + exception.what());
  }
  text.resize((text.size() + 7) / 8 * 8, ' ');
  return text;
}

}  // namespace

size_t SizeInBytes(TensorType type) { return Info(type).size; }

std::string_view TensorTypeName(TensorType type) { return Info(type).name; }

SafetensorsContent ParseSafetensors(std::span<const std::byte> bytes,
                                    const std::filesystem::path& path) {
  const std::string_view header_text = HeaderText(bytes, path);
  const auto data = bytes.subspan(kLengthBytes + header_text.size());
  const Json header = ParseHeader(header_text, path);
  SafetensorsContent content;
  for (const auto& [name, entry] : header.items()) {
    if (name == kMetadataKey) {
      content.metadata = ParseMetadata(entry, path);
    } else {
      content.tensors.emplace(name, ParseTensor(name, entry, data, path));
    }
  }
  CheckCoverage(content.tensors, data, path);
  return content;
}

void StreamSafetensors(const std::filesystem::path& path,
                       const TensorLayouts& layouts,
                       const TensorSource& source,
                       const std::map<std::string, std::string>& metadata) {
  const auto order = DataOrder(layouts);
  const std::string header = HeaderFor(order, metadata);
  const uint64_t length = header.size();

  AtomicFile file(path);
  file.Write(std::as_bytes(std::span(&length, 1)));
  file.Write(header);
  for (const auto* named : order) {
    const auto& [name, layout] = *named;
    uint64_t num_bytes = 0;
    source(name, [&](std::span<const std::byte> bytes) {
      num_bytes += bytes.size();
      file.Write(bytes);
    });
    VGTW_CHECK(num_bytes == NumBytes(layout.shape, SizeInBytes(layout.type)),
               "bytes of tensor " + name + " do not fit its shape");
  }
  file.Commit();
}

void WriteSafetensors(const std::filesystem::path& path,
                      const StoredTensors& tensors,
                      const std::map<std::string, std::string>& metadata) {
  TensorLayouts layouts;
  for (const auto& [name, tensor] : tensors) {
    VGTW_CHECK(NumBytes(tensor.shape, SizeInBytes(tensor.type)) == tensor.bytes.size(),
               "bytes of tensor " + name + " do not fit its shape");
    layouts.emplace(name, TensorLayout{tensor.type, tensor.shape});
  }
  const TensorSource source = [&](const std::string& name, const ByteSink& sink) {
    sink(tensors.find(name)->second.bytes);
  };
  StreamSafetensors(path, layouts, source, metadata);
}

std::vector<float> ToFloats(const StoredTensor& tensor) {
  const auto load = [&]<typename Stored>(auto&& to_float, Stored) {
    std::vector<float> values(tensor.NumElements());
    for (size_t i = 0; i < values.size(); ++i) {
      Stored stored;
      std::memcpy(&stored, tensor.bytes.data() + i * sizeof(Stored), sizeof(Stored));
      values[i] = to_float(stored);
    }
    return values;
  };
  switch (tensor.type) {
    case TensorType::kF64:
      return load([](double value) { return static_cast<float>(value); }, double{});
    case TensorType::kF32:
      return load([](float value) { return value; }, float{});
    case TensorType::kF16:
      return load(FloatOfHalf, uint16_t{});
    case TensorType::kBF16:
      return load(FloatOfBrain, uint16_t{});
    default:
      throw std::invalid_argument("tensor of type " + std::string(TensorTypeName(tensor.type)) +
                                  " has no floating-point values");
  }
}

}  // namespace vgtw
