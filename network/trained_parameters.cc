// SPDX-License-Identifier: BSD-3-Clause
#include "network/trained_parameters.h"

#include "network/weights.h"
#include "scene/error.h"
#include "scene/random.h"

#include <cmath>
#include <cstddef>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr double kTokenSigma = 0.02;
constexpr float kLayerScale = 0.1f;
constexpr int kNumCameraSteps = 4;  // each adds the bias of the pose branch

bool Contains(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

// FNV-1a.
uint64_t HashName(std::string_view name) {
  uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return hash;
}

template <typename Draw>
at::Tensor Filled(const Shape& shape, const Draw& draw) {
  const at::Tensor values = at::empty(shape, at::kFloat);
  float* data = values.data_ptr<float>();
  for (int64_t i = 0; i < values.numel(); ++i) data[i] = static_cast<float>(draw());
  return values;
}

at::Tensor FreshMatrix(std::string_view name, const Shape& shape, RandomStream& random) {
  const auto num_weights = static_cast<double>(c10::multiply_integers(shape));
  const double fan_in = num_weights / static_cast<double>(shape[0]);
  const auto uniform = [&](double limit) {
    return Filled(shape, [&random, limit] { return random.Uniform(-limit, limit); });
  };
  // A transposed convolution [in, out, k, k] whose tiles do not overlap: `in` terms each.
  if (Contains(name, "resize_layers.0") || Contains(name, "resize_layers.1")) {
    return uniform(1.0 / std::sqrt(static_cast<double>(shape[0])));
  }
  if (shape.size() > 2 || Contains(name, "lora_A_")) return uniform(1.0 / std::sqrt(fan_in));
  return uniform(std::sqrt(6.0 / (fan_in + static_cast<double>(shape[0]))));
}

// The network's first guess of a camera.
at::Tensor PoseBias() {
  const at::Tensor encoding = at::zeros({9}, at::kFloat);
  encoding[6] = 1.0;  // w of the quaternion
  encoding.slice(0, 7).fill_(1.0);
  return encoding / kNumCameraSteps;
}

at::Tensor Copy(const StoredTensor& stored, const std::string& name, const Shape& shape) {
  VGTW_CHECK(Shape(stored.shape.begin(), stored.shape.end()) == shape, name);
  const std::vector<float> values = ToFloats(stored);
  return at::tensor(values, at::kFloat).reshape(shape);
}

bool IsLastConvolution(std::string_view name) { return Contains(name, "scratch.output_conv2.2"); }

// The name of what a new distractor head starts from; "" if nothing.
std::string OriginOf(const std::string& name) {
  constexpr std::string_view kHead = "mask_head.";
  if (!name.starts_with(kHead) || IsLastConvolution(name)) return {};
  return "depth_head." + name.substr(kHead.size());
}

at::Tensor StartValue(const ListingSource::Row& row, const Checkpoint* start, uint64_t seed) {
  if (start != nullptr) {
    for (const std::string& name : {row.name, OriginOf(row.name)}) {
      const auto found = start->tensors().find(name);
      if (found != start->tensors().end()) return Copy(found->second, name, row.shape);
    }
  }
  return FreshValue(row.name, row.shape, seed);
}

}  // namespace

ParameterGroup GroupOf(std::string_view name) {
  if (Contains(name, ".attn.lora_")) return ParameterGroup::kLora;
  if (name.starts_with("mask_head.")) return ParameterGroup::kDistractorHead;
  const bool is_trunk = name.starts_with("aggregator.") || name.starts_with("encoder.") ||
                        name.starts_with("decoder.") || name == "register_token";
  return is_trunk ? ParameterGroup::kTrunk : ParameterGroup::kHeads;
}

at::Tensor FreshValue(std::string_view name, const Shape& shape, uint64_t seed) {
  RandomStream random(HashKey({seed, HashName(name)}));
  if (Contains(name, "lora_B_") || Contains(name, "empty_pose"))
    return at::zeros(shape, at::kFloat);
  if (name.ends_with("gamma")) return at::full(shape, kLayerScale, at::kFloat);
  if (Contains(name, "token") && !name.ends_with("norm.weight") && !name.ends_with("norm.bias")) {
    return Filled(shape, [&random] { return kTokenSigma * random.Normal(); });
  }
  if (Contains(name, "pos_embed")) {
    return Filled(shape, [&random] { return kTokenSigma * random.Normal(); });
  }
  if (name.ends_with("pose_branch.fc2.bias")) return PoseBias();
  if (shape.size() < 2) {
    return name.ends_with("weight") ? at::ones(shape, at::kFloat) : at::zeros(shape, at::kFloat);
  }
  return FreshMatrix(name, shape, random);
}

TrainedParameters::TrainedParameters(const NetworkDescription& network,
                                     const Checkpoint* start,
                                     TrainedParts parts,
                                     uint64_t seed,
                                     const at::Device& device) {
  ListingSource listing;
  BuildModel(ParameterScope(listing), network);
  for (const ListingSource::Row& row : listing.rows()) {
    TrainedParameter parameter;
    parameter.name = row.name;
    parameter.group = GroupOf(row.name);
    const bool is_new_part = parameter.group == ParameterGroup::kLora ||
                             parameter.group == ParameterGroup::kDistractorHead;
    parameter.is_trained = parts == TrainedParts::kAll || is_new_part;
    parameter.decays = row.shape.size() > 1 && parameter.group != ParameterGroup::kLora &&
                       !Contains(row.name, "token") && !Contains(row.name, "pos_embed");
    parameter.value = StartValue(row, start, seed).to(device);
    idx_by_name_.emplace(row.name, parameters_.size());
    parameters_.push_back(std::move(parameter));
  }
}

int64_t TrainedParameters::NumTrained() const {
  int64_t num = 0;
  for (const TrainedParameter& parameter : parameters_) {
    if (parameter.is_trained) num += parameter.value.numel();
  }
  return num;
}

LeafSource::LeafSource(const TrainedParameters& parameters) : parameters_(parameters) {
  for (const TrainedParameter& parameter : parameters.all()) {
    leaves_.push_back(parameter.value.detach().requires_grad_(parameter.is_trained));
  }
}

at::Tensor LeafSource::Get(const std::string& name, const Shape& shape, at::ScalarType type) {
  const at::Tensor& leaf = leaves_[parameters_.IndexOf(name)];
  VGTW_CHECK(leaf.sizes() == at::IntArrayRef(shape), name);
  return leaf.to(type);
}

void LeafSource::ClearGradients() {
  for (at::Tensor& leaf : leaves_) leaf.mutable_grad() = at::Tensor();
}

}  // namespace vgtw
