// SPDX-License-Identifier: BSD-3-Clause
// The parameters of a network that is trained. Internal to network/: needs LibTorch.
#pragma once

#include "network/checkpoint.h"
#include "network/identify.h"
#include "network/parameters.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

enum class TrainedParts {
  kAll,                   // of a network from nothing
  kLoraAndDistractorHead  // of VGTW on published weights, which stay as they are
};

// Parameters whose gradients are clipped together.
enum class ParameterGroup { kTrunk, kHeads, kLora, kDistractorHead };
inline constexpr size_t kNumParameterGroups = 4;
ParameterGroup GroupOf(std::string_view name);

// Values of a parameter that no file holds, on the CPU: a function of the seed and the name.
//   LoRA's A uniform in +-1/sqrt(in), its B zero: the network starts as it was without.
//   Linear layers and convolutions as Xavier and PyTorch draw them, biases zero, norms one, layer
//   scales 0.1, tokens and position embeddings normal with 0.02; the pose branch starts at the
//   identity and a field of view of one radian.
at::Tensor FreshValue(std::string_view name, const Shape& shape, uint64_t seed);

struct TrainedParameter {
  std::string name;
  at::Tensor value;  // float32
  bool is_trained = true;
  bool decays = false;  // weights of products, but for those of LoRA
  ParameterGroup group = ParameterGroup::kTrunk;
};

// All parameters of a network, in the order in which it asks for them.
class TrainedParameters {
 public:
  // Those that `start` (may be nullptr) holds are copied from there, others are fresh; a fresh
  // distractor head starts as the depth head of `start`, but for its last convolution.
  TrainedParameters(const NetworkDescription& network,
                    const Checkpoint* start,
                    TrainedParts parts,
                    uint64_t seed,
                    const at::Device& device);

  const std::vector<TrainedParameter>& all() const { return parameters_; }
  std::vector<TrainedParameter>& all() { return parameters_; }
  size_t IndexOf(const std::string& name) const { return idx_by_name_.at(name); }
  int64_t NumTrained() const;  // elements

 private:
  std::vector<TrainedParameter> parameters_;
  std::unordered_map<std::string, size_t> idx_by_name_;
};

// Answers with leaves of one worker: they share the values and have gradients of their own.
class LeafSource : public ParameterSource {
 public:
  explicit LeafSource(const TrainedParameters& parameters);
  at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType type) override;

  // Of parameters.all(), same order; undefined gradients where a parameter took no part.
  const std::vector<at::Tensor>& leaves() const { return leaves_; }
  void ClearGradients();

 private:
  const TrainedParameters& parameters_;
  std::vector<at::Tensor> leaves_;
};

}  // namespace vgtw
