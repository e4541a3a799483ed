// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/prediction.h"

namespace vgtw {

inline constexpr double kWallDepth = 5.1;

// A camera of 64 x 48 pixels and focal length 61.2 (PINHOLE) at (x, 0, 0) that looks along z at the
// wall z = 5.1, so that a step of 0.5 in x shifts its image by exactly 6 pixels. Maps are 32 x 24,
// half the photo's size.
inline ViewPrediction MakeWallView(const std::string& name, double x) {
  ViewPrediction prediction;
  View& view = prediction.view;
  view.name = name;
  view.camera = MakePinhole(64, 48, 61.2, 61.2);
  view.cam_from_world.translation = {-x, 0.0, 0.0};
  view.network_width = 32;
  view.network_height = 24;
  view.original_from_network << 2.0, 0.0, 0.0, 0.0, 2.0, 0.0;
  prediction.depth = DepthMap(32, 24, static_cast<float>(kWallDepth));
  return prediction;
}

// Views "a.png", "b.png", "c.png" at x = -0.5, 0, 0.5.
inline Prediction MakeWallPrediction() {
  Prediction prediction;
  prediction.producer = "wall";
  prediction.views = {
      MakeWallView("a.png", -0.5), MakeWallView("b.png", 0.0), MakeWallView("c.png", 0.5)};
  return prediction;
}

}  // namespace vgtw
