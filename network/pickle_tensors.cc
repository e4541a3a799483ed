// SPDX-License-Identifier: BSD-3-Clause
#include "network/pickle_tensors.h"

#include "scene/error.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

namespace vgtw {
namespace {

using Kind = PickleValue::Kind;

constexpr int kMaxDepth = 16;
constexpr size_t kMaxVisits = size_t{1} << 20;
constexpr size_t kMaxDimensions = 64;  // as in torch
constexpr uint64_t kMaxNumBytes = std::numeric_limits<int64_t>::max();
constexpr std::string_view kDamaged = "the file is damaged: copy or write it again";
constexpr std::string_view kSaveWeights =
    "save the weights alone: torch.save(model.state_dict(), path)";

constexpr std::array<std::pair<std::string_view, TensorType>, 8> kStorageTypes = {{
    {"torch.DoubleStorage", TensorType::kF64},
    {"torch.LongStorage", TensorType::kI64},
    {"torch.FloatStorage", TensorType::kF32},
    {"torch.IntStorage", TensorType::kI32},
    {"torch.HalfStorage", TensorType::kF16},
    {"torch.BFloat16Storage", TensorType::kBF16},
    {"torch.ByteStorage", TensorType::kU8},
    {"torch.BoolStorage", TensorType::kBool},
}};

std::optional<uint64_t> Multiply(uint64_t a, uint64_t b) {
  if (b != 0 && a > kMaxNumBytes / b) return std::nullopt;
  return a * b;
}

// One more than the largest index of a storage that a tensor without empty dimensions reaches.
std::optional<uint64_t> NumElementsReached(const PickledTensor& tensor) {
  uint64_t last = tensor.offset;
  for (size_t i = 0; i < tensor.shape.size(); ++i) {
    const auto step = Multiply(tensor.shape[i] - 1, tensor.strides[i]);
    if (!step || last > kMaxNumBytes - *step) return std::nullopt;
    last += *step;
  }
  return last + 1;
}

std::optional<uint64_t> NumBytes(const PickledTensor& tensor) {
  uint64_t num_bytes = SizeInBytes(tensor.type);
  for (const uint64_t dimension : tensor.shape) {
    const auto product = Multiply(num_bytes, dimension);
    if (!product) return std::nullopt;
    num_bytes = *product;
  }
  return num_bytes;
}

class Collector {
 public:
  Collector(const Pickle& pickle, const std::filesystem::path& path)
      : pickle_(pickle), path_(path) {}

  std::vector<PickledTensor> Collect() {
    const PickleValue* weights = &pickle_[pickle_.root()];
    if (weights->kind != Kind::kDict) {
      Fail(path_, "holds something else than a dict", "tensors by name", kSaveWeights);
    }
    for (int depth = 0; depth < kMaxDepth; ++depth) {
      const PickleValue* inner = DictOfWeights(*weights);
      if (inner == nullptr) break;
      weights = inner;
    }
    Walk(*weights, "", 0);
    return std::move(tensors_);
  }

 private:
  [[noreturn]] void FailAt(const std::string& name,
                           const std::string& found,
                           std::string_view expected) const {
    Fail(path_, "tensor '" + Printable(name) + "' " + found, expected, kDamaged);
  }

  // Values may be shared or contain themselves, so that walks have to be bounded.
  void Visit(int depth) {
    if (depth > kMaxDepth || ++num_visits_ > kMaxVisits) {
      Fail(path_,
           "nests its dicts too deeply or repeats them too often",
           "at most 16 levels and 2^20 entries",
           kSaveWeights);
    }
  }

  // The call that rebuilds a tensor, also one inside a Parameter; nullptr if `value` is neither.
  const PickleValue* TensorCall(const PickleValue& value) const {
    if (value.kind != Kind::kCall) return nullptr;
    if (value.text == "torch._utils._rebuild_tensor_v2") return &value;
    if (!value.text.starts_with("torch._utils._rebuild_parameter")) return nullptr;
    const auto& arguments = pickle_[value.items[0]].items;
    if (arguments.empty()) return nullptr;
    const PickleValue& inner = pickle_[arguments[0]];
    const bool is_tensor =
        inner.kind == Kind::kCall && inner.text == "torch._utils._rebuild_tensor_v2";
    return is_tensor ? &inner : nullptr;
  }

  bool HoldsTensors(const PickleValue& value, int depth) {
    if (TensorCall(value) != nullptr) return true;
    if (value.kind != Kind::kDict) return false;
    for (size_t i = 1; i < value.items.size(); i += 2) {
      Visit(depth);
      if (HoldsTensors(pickle_[value.items[i]], depth + 1)) return true;
    }
    return false;
  }

  // The dict of weights beside which `dict` holds only other things; nullptr if there is none.
  const PickleValue* DictOfWeights(const PickleValue& dict) {
    const PickleValue* found = nullptr;
    std::string_view found_key;
    for (size_t i = 0; i + 1 < dict.items.size(); i += 2) {
      const PickleValue& key = pickle_[dict.items[i]];
      const PickleValue& value = pickle_[dict.items[i + 1]];
      if (TensorCall(value) != nullptr) return nullptr;
      if (key.kind != Kind::kString || value.kind != Kind::kDict) continue;
      const auto& names = WeightKeys();
      if (std::find(names.begin(), names.end(), key.text) == names.end()) continue;
      if (!HoldsTensors(value, 0)) continue;
      if (found != nullptr) {
        Fail(path_,
             "holds tensors under '" + std::string(found_key) + "' and '" + std::string(key.text) +
                 "'",
             "one network",
             kSaveWeights);
      }
      found = &value;
      found_key = key.text;
    }
    return found;
  }

  void Walk(const PickleValue& dict, const std::string& prefix, int depth) {
    std::set<std::string_view> keys;
    for (size_t i = 0; i + 1 < dict.items.size(); i += 2) {
      Visit(depth);
      const PickleValue& key = pickle_[dict.items[i]];
      const PickleValue& value = pickle_[dict.items[i + 1]];
      const PickleValue* call = TensorCall(value);
      if (key.kind != Kind::kString || (call == nullptr && value.kind != Kind::kDict)) continue;
      const std::string name = prefix + std::string(key.text);
      if (Printable(key.text) != key.text || !keys.insert(key.text).second) {
        FailAt(name, "has a key that is there twice or no text", "one of at most 200 characters");
      }
      if (call != nullptr) {
        tensors_.push_back(ReadTensor(name, pickle_[call->items[0]].items));
      } else {
        Walk(value, name + ".", depth + 1);
      }
    }
  }

  // Arguments: storage, offset, shape, strides, requires_grad, hooks and, if at all, metadata.
  PickledTensor ReadTensor(const std::string& name, const std::vector<PickleId>& arguments) const {
    if (arguments.size() < 4) FailAt(name, "has too few arguments", "at least four");
    // Metadata tells of values that are to be negated or conjugated.
    if (arguments.size() > 6 && pickle_[arguments[6]].items.size() > 0) {
      FailAt(name, "is a lazily negated or conjugated view", "one without metadata");
    }
    PickledTensor tensor;
    tensor.name = name;
    ReadStorage(pickle_[arguments[0]], tensor);
    tensor.offset = ReadUnsigned(name, pickle_[arguments[1]]);
    tensor.shape = ReadDimensions(name, pickle_[arguments[2]]);
    tensor.strides = ReadDimensions(name, pickle_[arguments[3]]);
    CheckReach(tensor);
    return tensor;
  }

  // A persistent id is ("storage", type, key, device, number of elements).
  void ReadStorage(const PickleValue& value, PickledTensor& tensor) const {
    const PickleValue* id = value.kind == Kind::kPersistent ? &pickle_[value.items[0]] : nullptr;
    const bool is_storage = id != nullptr && id->kind == Kind::kTuple && id->items.size() == 5 &&
                            pickle_[id->items[0]].text == "storage" &&
                            pickle_[id->items[1]].kind == Kind::kGlobal &&
                            pickle_[id->items[2]].kind == Kind::kString;
    if (!is_storage) FailAt(tensor.name, "has no storage", "one of torch.save's");
    const auto type =
        std::find_if(kStorageTypes.begin(), kStorageTypes.end(), [&](const auto& named) {
          return named.first == pickle_[id->items[1]].text;
        });
    if (type == kStorageTypes.end()) FailAt(tensor.name, "has a storage of no type", "one");
    tensor.type = type->second;
    tensor.storage_key = pickle_[id->items[2]].text;
    tensor.num_storage_elements = ReadUnsigned(tensor.name, pickle_[id->items[4]]);
  }

  uint64_t ReadUnsigned(const std::string& name, const PickleValue& value) const {
    if (value.kind != Kind::kInt || value.number < 0) {
      FailAt(name,
             value.kind == Kind::kInt ? "has a size of " + std::to_string(value.number)
                                      : "has a size that is no integer of 64 bits",
             "whole numbers >= 0");
    }
    return static_cast<uint64_t>(value.number);
  }

  std::vector<uint64_t> ReadDimensions(const std::string& name, const PickleValue& value) const {
    if (value.kind != Kind::kTuple || value.items.size() > kMaxDimensions) {
      FailAt(name, "has no usable shape or strides", "tuples of at most 64 numbers");
    }
    std::vector<uint64_t> dimensions;
    for (const PickleId id : value.items) dimensions.push_back(ReadUnsigned(name, pickle_[id]));
    return dimensions;
  }

  void CheckReach(const PickledTensor& tensor) const {
    if (tensor.shape.size() != tensor.strides.size()) {
      FailAt(tensor.name, "has not as many strides as dimensions", "as many");
    }
    if (!Multiply(tensor.num_storage_elements, SizeInBytes(tensor.type))) {
      FailAt(tensor.name, "has an absurdly large storage", "less than 2^63 bytes");
    }
    const bool is_empty =
        std::find(tensor.shape.begin(), tensor.shape.end(), 0u) != tensor.shape.end();
    if (is_empty) return;
    const auto num_reached = NumElementsReached(tensor);
    if (!num_reached || *num_reached > tensor.num_storage_elements || !NumBytes(tensor)) {
      FailAt(tensor.name,
             "reaches beyond its storage of " + std::to_string(tensor.num_storage_elements) +
                 " elements or the limits of 64 bits",
             "elements inside");
    }
  }

  const Pickle& pickle_;
  const std::filesystem::path& path_;
  std::vector<PickledTensor> tensors_;
  size_t num_visits_ = 0;
};

}  // namespace

const std::vector<std::string>& WeightKeys() {
  static const std::vector<std::string> keys = {
      "model", "state_dict", "model_state_dict", "module"};
  return keys;
}

std::vector<PickledTensor> PickledTensors(const Pickle& pickle, const std::filesystem::path& path) {
  return Collector(pickle, path).Collect();
}

}  // namespace vgtw
