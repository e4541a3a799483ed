// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/depth_map.h"
#include "scene/distractor_mask.h"
#include "scene/grid.h"
#include "scene/view.h"

#include <string>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// One depth measurement where a producer gave only samples instead of maps.
struct DepthSample {
  Eigen::Vector2f pixel_in_original = Eigen::Vector2f::Zero();
  float depth = 0.0f;       // z-depth, scene units
  float confidence = 1.0f;  // larger is better
};

// What a feed-forward network says about one photo. Every map is [H,W] in network pixels with the
// view's network size, or empty where the producer gave none.
struct ViewPrediction {
  View view;
  DepthMap depth;
  ConfidenceMap depth_conf;
  DistractorMask distractor;
  Grid<Eigen::Vector3f> points;  // world coordinates
  std::vector<DepthSample> depth_samples;
};

// A set of photos in one world frame and one scale. Views are sorted byte-wise by name.
struct Prediction {
  std::string producer;      // program or network that made it
  std::string weights_hash;  // of its weights, "" if unknown
  std::vector<ViewPrediction> views;
};

// Why the view cannot be used (map of the wrong size, NaN or non-finite pose, rotation not a unit
// quaternion, camera fault, unsafe name, probability outside [0,1], depth <= 0), or "".
std::string FindFault(const ViewPrediction& prediction);

}  // namespace vgtw
