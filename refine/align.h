// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/reconstruction.h"
#include "scene/sim3d.h"

#include <set>

namespace vgtw {

// The similarity that brings the model's poses to those of `reference`, over the images of both but
// `left_out`: the rotation nearest to those of most views, then scale and shift of their centres,
// by absolute distances, so that a few views that moved do not count. Determined also for two views
// and for centres on a line; the scale is 1 where all centres coincide, and all is the identity
// where no image is common.
Sim3d AlignPoses(const Reconstruction& model,
                 const Reconstruction& reference,
                 const std::set<ImageId>& left_out = {});

// Moves cameras and points into the world b.
void Transform(const Sim3d& b_from_world, Reconstruction& model);

}  // namespace vgtw
