// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/train.h"
#include "network/training_sample.h"
#include "scene/scene_stream.h"

#include <cstdint>

namespace vgtw {

// Rendered scenes, their views in random order: photo sets have none. The sky has no depth. Width
// and height of the stream must be multiples of the patch size.
class SceneSamples : public SampleSource {
 public:
  SceneSamples(const SceneStreamOptions& options, SceneKind kind);
  TrainingSample Get(uint64_t idx) const override;

 private:
  SceneKind kind_;
  SceneStream stream_;
};

}  // namespace vgtw
