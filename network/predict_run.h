// SPDX-License-Identifier: BSD-3-Clause
// Photos to predictions with a network that is loaded. Internal to network/: needs LibTorch.
#pragma once

#include "network/model.h"
#include "network/photo_loader.h"
#include "network/predict.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

struct ReadyNetwork {
  const Model* model = nullptr;
  NetworkDescription description;
  at::Device device = at::kCPU;
  int64_t weights_bytes = 0;  // in the device's memory; 0 if the file's pages serve
  // [S, 3, H, W] in [0, 1] to one vector per view [S, E]; empty where no view is the reference.
  std::function<at::Tensor(const at::Tensor& images)> describe_views = {};
  // Called after every transformer block.
  std::function<void()> release_memory = {};
};

// Transformer blocks of encoder and trunk.
int64_t NumBlocks(const NetworkDescription& description);

// The official loader of a network.
PreprocessOptions LoaderOf(const NetworkDescription& description, const PredictOptions& options);

// How many of these photos fit into memory in one pass; 0 = what is free. Throws Error if two do
// not.
int MaxViewsAtOnce(const ReadyNetwork& network, double max_memory_gib, const PhotoLoader& photos);

// See Predictor::Run.
PredictSummary PredictViews(const ReadyNetwork& network,
                            const PredictOptions& options,
                            const std::filesystem::path& image_folder,
                            const std::vector<std::string>& image_names,
                            const std::function<void(const ViewPrediction&)>& on_prediction,
                            const ProgressCallback& progress);

// The view whose vector [S, E] has the largest mean cosine to those of all views.
int64_t MostConnectedView(const at::Tensor& descriptions);

}  // namespace vgtw
