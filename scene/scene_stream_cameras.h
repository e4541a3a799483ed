// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/camera.h"
#include "scene/random.h"
#include "scene/rigid3d.h"
#include "scene/scene_stream_raycast.h"
#include "scene/scene_stream_stage.h"

#include <optional>
#include <vector>

namespace vgtw {

struct StreamView {
  Camera camera;
  Rigid3d cam_from_world;
  // The static scene at the pixel centres of a coarse camera, about 32 pixels wide.
  Camera coarse_camera;
  HitMap coarse;
};

// Median of the coarse z-depths.
double MedianDepth(const StreamView& view);

struct CameraOptions {
  int num_views = 2;
  int width = 112;
  int height = 84;
};

// Draws a path (arc, forward, lateral or a walk) on which no camera is inside or close to something
// and neighbours see much of the same; nullopt if none of a few is such.
std::optional<std::vector<StreamView>> DrawViews(const Stage& stage,
                                                 const CameraOptions& options,
                                                 RandomStream& random);

}  // namespace vgtw
