// SPDX-License-Identifier: BSD-3-Clause
// What a network gives for one view, in its conventions, becomes a ViewPrediction. Internal to
// network/: needs LibTorch.
#pragma once

#include "network/model.h"
#include "network/preprocess.h"
#include "scene/prediction.h"

#include <cstdint>
#include <string>

namespace vgtw {

// [H, W] on any device; what is not finite becomes NaN; undefined becomes empty.
Grid<float> ToGrid(const at::Tensor& map);

// Outputs of one view, without the leading dimension of CameraOutputs and DenseOutputs.
struct RawView {
  at::Tensor cam_from_world;  // [3, 4]
  at::Tensor intrinsics;      // [3, 3], undefined for pi3
  DenseOutputs maps;
};
RawView SelectView(const CameraOutputs& cameras,
                   int64_t camera_idx,
                   const DenseOutputs& maps,
                   int64_t map_idx);

struct ConvertedView {
  ViewPrediction prediction;
  std::string fault;  // why the prediction cannot be used, or ""
};

// Conventions, equal to those of the importer of the networks' files:
//   VGGT says that its principal point is W/2 and means the middle of the image, corner to corner;
//   so its intrinsics hold for continuous pixels as they are, and value [y, x] of its maps belongs
//   to the centre (x + 0.5, y + 0.5).
//   pi3 gives rays at the centres of pixels and no intrinsics. They are fitted at integer positions
//   over pixels of the photo that are no distractors, weighted by confidence, and moved by half a
//   pixel; its depth is the z of its local points, its confidence a logit.
// Bars, depths <= 0 and what is not finite become unknown.
ConvertedView ConvertView(const std::string& name,
                          const PhotoPlacement& placement,
                          const RawView& raw,
                          bool with_points);

}  // namespace vgtw
