// SPDX-License-Identifier: BSD-3-Clause
#include "network/weights.h"

#include "network/pi3.h"
#include "network/vggt.h"
#include "network/weights_audit.h"
#include "scene/error.h"

#include <cstdint>
#include <cstring>
#include <utility>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

std::optional<at::ScalarType> ScalarTypeOf(TensorType type) {
  switch (type) {
    case TensorType::kF64:
      return at::kDouble;
    case TensorType::kF32:
      return at::kFloat;
    case TensorType::kF16:
      return at::kHalf;
    case TensorType::kBF16:
      return at::kBFloat16;
    default:
      return std::nullopt;
  }
}

// The bytes of `stored` themselves, or a copy of them where they are not aligned.
at::Tensor View(const StoredTensor& stored, const Shape& shape, at::ScalarType type) {
  const auto address = reinterpret_cast<uintptr_t>(stored.bytes.data());
  if (address % SizeInBytes(stored.type) == 0) {
    return at::from_blob(const_cast<std::byte*>(stored.bytes.data()), shape, at::dtype(type));
  }
  const at::Tensor copy = at::empty(shape, at::dtype(type));
  std::memcpy(copy.data_ptr(), stored.bytes.data(), stored.bytes.size());
  return copy;
}

void RequireKind(const std::optional<NetworkKind>& wanted,
                 NetworkKind kind,
                 const std::filesystem::path& path) {
  if (!wanted || *wanted == kind) return;
  const bool lacks_extension = (*wanted == NetworkKind::kVgtw && kind == NetworkKind::kVggt) ||
                               (*wanted == NetworkKind::kVgtwPi3 && kind == NetworkKind::kPi3);
  Fail(path,
       "holds the weights of " + std::string(NetworkKindName(kind)),
       "those of " + std::string(NetworkKindName(*wanted)),
       lacks_extension ? "give the LoRA and distractor head, too, as --lora_path" : "");
}

}  // namespace

at::Tensor CheckpointSource::Get(const std::string& name, const Shape& shape, at::ScalarType type) {
  const auto found = checkpoint_.tensors().find(name);
  VGTW_CHECK(found != checkpoint_.tensors().end(), name);
  const StoredTensor& stored = found->second;
  const auto stored_type = ScalarTypeOf(stored.type);
  VGTW_CHECK(stored_type && Shape(stored.shape.begin(), stored.shape.end()) == shape, name);
  const at::Tensor view = View(stored, shape, *stored_type);
  const at::Tensor tensor = view.to(at::device(device_).dtype(type));
  if (!tensor.is_same(view)) limiter_.AddRead(stored.bytes.size());
  // Also between the 16-bit types: float16 has the smaller range.
  const bool may_overflow =
      type != *stored_type && c10::elementSize(type) <= c10::elementSize(*stored_type);
  if (may_overflow && !tensor.isfinite().all().item<bool>()) {
    throw Error("tensor '" + Printable(name) + "' has values too large for " + c10::toString(type) +
                ": choose another precision");
  }
  return tensor;
}

std::unique_ptr<Model> BuildModel(const ParameterScope& scope,
                                  const NetworkDescription& description) {
  if (const auto* pi3 = std::get_if<Pi3Config>(&description.config)) {
    return std::make_unique<Pi3>(scope, *pi3);
  }
  return std::make_unique<Vggt>(scope, std::get<VggtConfig>(description.config));
}

LoadedNetwork LoadNetwork(const std::vector<std::filesystem::path>& files,
                          const LoadOptions& options) {
  const std::filesystem::path path = NameOf(files);
  Checkpoint weights = OpenWeights(files);
  const WeightsAudit audit =
      AuditWeights(weights,
                   path,
                   options.check_values ? ValueCheck::kFinite : ValueCheck::kNone,
                   options.num_threads,
                   options.progress);
  RequireKind(options.kind, audit.description.kind, path);
  RequireComplete(audit, path);
  LoadedNetwork network{std::move(weights), audit.description, audit.ignored, nullptr};
  CheckpointSource source(network.weights, options.device);
  network.model = BuildModel(ParameterScope(source, options.product_type), network.description);
  network.ReleasePages();
  return network;
}

NetworkDescription TryWeights(const std::vector<std::filesystem::path>& files,
                              int num_threads,
                              const ProgressCallback& progress) {
  return LoadNetwork(files, {.num_threads = num_threads, .progress = progress}).description;
}

}  // namespace vgtw
