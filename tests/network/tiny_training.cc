// SPDX-License-Identifier: BSD-3-Clause
#include "tests/network/tiny_training.h"

namespace vgtw {

VggtConfig TrainableSizes() {
  VggtConfig sizes;
  sizes.encoder.reset();
  sizes.dim = 16;
  sizes.depth = 4;
  sizes.num_heads = 2;
  sizes.num_camera_heads = 2;
  sizes.num_camera_blocks = 1;
  sizes.head_layers = {0, 1, 2, 3};
  sizes.dpt = {.num_features = 8, .num_channels = {8, 8, 8, 8}};
  sizes.has_point_head = false;
  return sizes;
}

NetworkDescription TrainableNetwork() { return {NetworkKind::kVggt, TrainableSizes()}; }

TrainOptions ShortRun(bool lora_only) {
  TrainOptions options;
  options.sizes = TrainableSizes();
  options.lora_only = lora_only;
  options.lora.rank = 2;
  options.scenes.width = 42;
  options.scenes.height = 28;
  options.scenes.max_views = 2;
  options.samples_per_step = 2;
  options.num_steps = 6;
  options.validate_every = 3;
  options.num_validation_scenes = 2;
  options.num_threads = 1;
  if (!lora_only) options.loss_weights = {0.0, 0.0, 0.0, 1.0, 1.0};
  return options;
}

}  // namespace vgtw
