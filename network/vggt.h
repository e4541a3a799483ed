// SPDX-License-Identifier: BSD-3-Clause
// Internal to network/: needs LibTorch.
#pragma once

#include "network/aggregator.h"
#include "network/camera_head.h"
#include "network/config.h"
#include "network/dpt_head.h"
#include "network/model.h"

#include <array>
#include <optional>
#include <vector>

#include <ATen/core/Tensor.h>

namespace vgtw {

// VGGT, and VGTW where the configuration has a LoRA and a distractor head.
class Vggt : public Model {
 public:
  Vggt(const ParameterScope& scope, const VggtConfig& config);

  Features Encode(const at::Tensor& images, const EncodeOptions& options) const override;
  CameraOutputs PredictCameras(const Features& features) const override;
  DenseOutputs PredictMaps(const Features& features,
                           int64_t begin,
                           int64_t end,
                           const MapChoice& choice) const override;

  const TransformerBlock& GlobalBlock(int64_t layer) const override;

  const Aggregator& aggregator() const { return aggregator_; }

 private:
  VggtConfig config_;
  Aggregator aggregator_;
  CameraHead camera_head_;
  DptHead depth_head_;
  std::optional<DptHead> point_head_;
  std::optional<DptHead> distractor_head_;
};

}  // namespace vgtw
