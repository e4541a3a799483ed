// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/checkpoint.h"
#include "network/identify.h"
#include "network/model.h"
#include "network/parameters.h"
#include "scene/progress.h"

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// Answers with the tensors of a checkpoint. What lies there in the type that is asked for, and is
// wanted on the CPU, is not copied: it is pages of the file, which must not be written to.
class CheckpointSource : public ParameterSource {
 public:
  // `checkpoint` must outlive the tensors.
  explicit CheckpointSource(const Checkpoint& checkpoint, at::Device device = at::kCPU)
      : checkpoint_(checkpoint), limiter_(checkpoint), device_(device) {}

  // Throws std::invalid_argument if the checkpoint has no such tensor of floating point and of this
  // shape (AuditWeights tells before); Error if a value is too large for `type`.
  at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType type) override;

 private:
  const Checkpoint& checkpoint_;
  PageLimiter limiter_;
  at::Device device_;
};

// Builds a network from what `scope` answers.
std::unique_ptr<Model> BuildModel(const ParameterScope& scope,
                                  const NetworkDescription& description);

struct LoadOptions {
  std::optional<NetworkKind> kind = {};  // must be the one that the weights are of
  at::Device device = at::kCPU;
  at::ScalarType product_type = at::kFloat;  // of linear layers and convolutions
  bool check_values = true;        // look for NaN and infinity, which reads the files once
  int num_threads = 0;             // for that; 0 = all cores
  ProgressCallback progress = {};  // of that, in tensors
};

// A network that is ready to run. On a CPU, float32 parameters that a file holds as such are not
// copied: they are pages of the file, read when first used.
struct LoadedNetwork {
  Checkpoint weights;  // outlives the model
  NetworkDescription description;
  std::vector<std::string> ignored;  // tensors that no network here needs ("track_head.*")
  std::unique_ptr<Model> model;

  // Gives back the memory of mapped pages; they are read again when they are needed again.
  void ReleasePages() const { weights.ReleasePages(); }
};

// Loads the weights of `files`; what a later file holds replaces the same names of earlier ones (a
// LoRA and distractor head over VGGT-1B). Throws Error as Checkpoint and AuditWeights do, one that
// tells all (WeightsAudit) if the weights are not exactly those of a network, and if they are of
// another kind than `options` want.
LoadedNetwork LoadNetwork(const std::vector<std::filesystem::path>& files,
                          const LoadOptions& options);

}  // namespace vgtw
