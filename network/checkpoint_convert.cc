// SPDX-License-Identifier: BSD-3-Clause
#include "network/checkpoint_convert.h"

#include "scene/error.h"
#include "scene/float16.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace vgtw {
namespace {

constexpr size_t kChunkElements = size_t{1} << 18;

bool IsFloating(TensorType type) {
  return type == TensorType::kF64 || type == TensorType::kF32 || type == TensorType::kF16 ||
         type == TensorType::kBF16;
}

// Rounds to the neighbour whose last bit is 1 unless exact. A float has more than two bits more
// than the 16-bit types, so rounding it once more gives what rounding `value` at once would.
float RoundToOdd(double value) {
  const auto nearest = static_cast<float>(value);
  if (std::isnan(value) || static_cast<double>(nearest) == value) return nearest;
  auto bits = std::bit_cast<uint32_t>(nearest);
  if (std::abs(static_cast<double>(nearest)) > std::abs(value)) --bits;  // towards zero
  return std::bit_cast<float>(bits | 1);
}

// Elements `begin` to `begin + values.size()` of a tensor of F32, F16 or BF16.
void LoadFloats(const StoredTensor& tensor, size_t begin, std::vector<float>& values) {
  const size_t size = SizeInBytes(tensor.type);
  values = ToFloats(
      {tensor.type, {values.size()}, tensor.bytes.subspan(begin * size, values.size() * size)});
}

// The same for F64; whether a finite value became infinite.
bool LoadDoubles(const StoredTensor& tensor,
                 size_t begin,
                 bool is_rounded_again,
                 std::vector<float>& values) {
  bool overflows = false;
  for (size_t i = 0; i < values.size(); ++i) {
    double value = 0;
    std::memcpy(&value, tensor.bytes.data() + (begin + i) * sizeof(value), sizeof(value));
    values[i] = is_rounded_again ? RoundToOdd(value) : static_cast<float>(value);
    overflows |= std::isinf(values[i]) && std::isfinite(value);
  }
  return overflows;
}

// Whether a finite value became infinite.
bool Narrow(const std::vector<float>& values, TensorType type, std::vector<uint16_t>& narrow) {
  const bool is_half = type == TensorType::kF16;
  const uint16_t infinity = is_half ? 0x7c00 : 0x7f80;
  bool overflows = false;
  narrow.resize(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    narrow[i] = is_half ? HalfOfFloat(values[i]) : BrainOfFloat(values[i]);
    overflows |= (narrow[i] & 0x7fff) == infinity && std::isfinite(values[i]);
  }
  return overflows;
}

// Gives `tensor` as `type` to `sink`, in chunks; whether a finite value became infinite.
bool Convert(const StoredTensor& tensor, TensorType type, const ByteSink& sink) {
  std::vector<float> values;
  std::vector<uint16_t> narrow;
  bool overflows = false;
  const size_t num_elements = tensor.NumElements();
  for (size_t begin = 0; begin < num_elements; begin += kChunkElements) {
    values.resize(std::min(kChunkElements, num_elements - begin));
    if (tensor.type == TensorType::kF64) {
      overflows |= LoadDoubles(tensor, begin, type != TensorType::kF32, values);
    } else {
      LoadFloats(tensor, begin, values);
    }
    if (type == TensorType::kF32) {
      sink(std::as_bytes(std::span(values)));
    } else {
      overflows |= Narrow(values, type, narrow);
      sink(std::as_bytes(std::span(narrow)));
    }
  }
  return overflows;
}

}  // namespace

void ConvertCheckpoint(const Checkpoint& checkpoint,
                       TensorType float_type,
                       const std::filesystem::path& output,
                       bool overwrite,
                       const ProgressCallback& progress) {
  VGTW_CHECK(IsFloating(float_type) && float_type != TensorType::kF64, "F32, F16 or BF16");
  std::error_code ignored;
  if (!overwrite && std::filesystem::exists(output, ignored)) {
    Fail(output, "exists", "a new file", "name another or add --overwrite");
  }
  TensorLayouts layouts;
  int64_t num_bytes = 0;
  int64_t num_bytes_done = 0;
  PageLimiter limiter(checkpoint);
  for (const auto& [name, tensor] : checkpoint.tensors()) {
    layouts[name] = {IsFloating(tensor.type) ? float_type : tensor.type, tensor.shape};
    num_bytes += static_cast<int64_t>(tensor.bytes.size());
  }
  const TensorSource source = [&](const std::string& name, const ByteSink& sink) {
    const StoredTensor& tensor = checkpoint.tensors().find(name)->second;
    if (!IsFloating(tensor.type) || tensor.type == float_type) {
      sink(tensor.bytes);
    } else if (Convert(tensor, float_type, sink)) {
      Fail(output,
           "tensor '" + Printable(name) + "' has values too large for " +
               std::string(TensorTypeName(float_type)),
           "values in its range",
           "convert to BF16 or F32");
    }
    limiter.AddRead(tensor.bytes.size());
    num_bytes_done += static_cast<int64_t>(tensor.bytes.size());
    if (progress) progress(num_bytes_done, num_bytes);
  };
  StreamSafetensors(output, layouts, source, checkpoint.metadata());
}

}  // namespace vgtw
