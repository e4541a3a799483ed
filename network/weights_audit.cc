// SPDX-License-Identifier: BSD-3-Clause
#include "network/weights_audit.h"

#include "network/weights.h"
#include "scene/error.h"
#include "scene/parallel.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <utility>

namespace vgtw {
namespace {

constexpr size_t kNumExamples = 3;

template <typename Bits>
bool HasFullExponent(std::span<const std::byte> bytes, Bits exponent) {
  bool found = false;
  for (size_t i = 0; i < bytes.size(); i += sizeof(Bits)) {
    Bits bits = 0;
    std::memcpy(&bits, bytes.data() + i, sizeof(bits));
    found |= (bits & exponent) == exponent;
  }
  return found;
}

bool HasNonFinite(const StoredTensor& tensor) {
  switch (tensor.type) {
    case TensorType::kF64:
      return HasFullExponent<uint64_t>(tensor.bytes, uint64_t{0x7ff} << 52);
    case TensorType::kF32:
      return HasFullExponent<uint32_t>(tensor.bytes, 0x7f800000);
    case TensorType::kF16:
      return HasFullExponent<uint16_t>(tensor.bytes, 0x7c00);
    case TensorType::kBF16:
      return HasFullExponent<uint16_t>(tensor.bytes, 0x7f80);
    default:
      return false;
  }
}

bool IsFloating(TensorType type) {
  return type == TensorType::kF64 || type == TensorType::kF32 || type == TensorType::kF16 ||
         type == TensorType::kBF16;
}

std::vector<std::string> FindNonFinite(const Checkpoint& weights,
                                       const std::vector<std::string>& names,
                                       int num_threads,
                                       const ProgressCallback& progress) {
  std::vector<char> is_bad(names.size(), 0);
  PageLimiter limiter(weights);
  const auto check = [&](int64_t i) {
    const auto index = static_cast<size_t>(i);
    const StoredTensor& tensor = weights.tensors().find(names[index])->second;
    is_bad[index] = HasNonFinite(tensor) ? 1 : 0;
    limiter.AddRead(tensor.bytes.size());
  };
  ParallelFor(static_cast<int64_t>(names.size()), num_threads, check, progress);
  weights.ReleasePages();
  std::vector<std::string> bad;
  for (size_t i = 0; i < names.size(); ++i) {
    if (is_bad[i] != 0) bad.push_back(names[i]);
  }
  return bad;
}

std::map<std::string, Shape, std::less<>> ParametersOf(const NetworkDescription& description) {
  ListingSource listing;
  BuildModel(ParameterScope(listing), description);
  std::map<std::string, Shape, std::less<>> parameters;
  for (const ListingSource::Row& row : listing.rows()) parameters.emplace(row.name, row.shape);
  return parameters;
}

// "lacks 4 tensors ('a', 'b', 'c', ...)"
void AddProblem(const std::string& what, const std::vector<std::string>& names, std::string& text) {
  if (names.empty()) return;
  if (!text.empty()) text += "; ";
  text += what + " " + std::to_string(names.size()) + (names.size() == 1 ? " tensor" : " tensors");
  for (size_t i = 0; i < std::min(kNumExamples, names.size()); ++i) {
    text += (i == 0 ? " (" : ", ") + Printable(names[i]);
  }
  text += names.size() > kNumExamples ? ", ...)" : ")";
}

}  // namespace

std::string FormatShape(const std::vector<uint64_t>& shape) {
  std::string text;
  for (const uint64_t size : shape) text += (text.empty() ? "" : "x") + std::to_string(size);
  return text.empty() ? "scalar" : text;
}

Checkpoint OpenWeights(const std::vector<std::filesystem::path>& files) {
  VGTW_CHECK(!files.empty(), "weights");
  Checkpoint weights(files.front());
  for (size_t i = 1; i < files.size(); ++i) weights.Overlay(Checkpoint(files[i]));
  return weights;
}

std::filesystem::path NameOf(const std::vector<std::filesystem::path>& files) {
  std::string name;
  for (const auto& file : files) name += (name.empty() ? "" : " + ") + file.string();
  return name;
}

std::string WeightsAudit::Problems() const {
  std::string text;
  AddProblem("lacks", missing, text);
  AddProblem("has another shape for", misshapen, text);
  AddProblem("has no floating-point numbers in", mistyped, text);
  AddProblem("has NaN or infinity in", not_finite, text);
  AddProblem("has", unknown, text);
  if (!unknown.empty()) text += " that the network does not know";
  return text;
}

WeightsAudit AuditWeights(const Checkpoint& weights,
                          const std::filesystem::path& path,
                          ValueCheck value_check,
                          int num_threads,
                          const ProgressCallback& progress) {
  WeightsAudit audit;
  TensorShapes shapes = ShapesOf(weights.tensors());
  for (const auto& [name, shape] : shapes) {
    if (IsOfTracker(name)) audit.ignored.push_back(name);
  }
  for (const std::string& name : audit.ignored) shapes.erase(name);
  audit.description = IdentifyNetwork(shapes, weights.metadata(), path);

  std::vector<std::string> present;
  for (const auto& [name, expected] : ParametersOf(audit.description)) {
    audit.num_parameters += c10::multiply_integers(expected);
    const auto found = shapes.find(name);
    if (found == shapes.end()) {
      audit.missing.push_back(name);
      continue;
    }
    if (Shape(found->second.begin(), found->second.end()) != expected) {
      audit.misshapen.push_back(name + " is " + FormatShape(found->second) + ", not " +
                                FormatShape({expected.begin(), expected.end()}));
    }
    const TensorType type = weights.tensors().find(name)->second.type;
    if (!IsFloating(type)) {
      audit.mistyped.push_back(name + " is " + std::string(TensorTypeName(type)));
    }
    present.push_back(name);
    shapes.erase(found);
  }
  for (const auto& [name, shape] : shapes) audit.unknown.push_back(name);
  if (value_check == ValueCheck::kFinite) {
    audit.not_finite = FindNonFinite(weights, present, num_threads, progress);
  }
  return audit;
}

void RequireComplete(const WeightsAudit& audit, const std::filesystem::path& path) {
  const std::string problems = audit.Problems();
  if (problems.empty()) return;
  Fail(path,
       problems,
       "exactly the weights of " + std::string(NetworkKindName(audit.description.kind)),
       "download the official file again");
}

}  // namespace vgtw
