// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/features.h"
#include "scene/static_view.h"
#include "scene/view.h"

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// The features of one photo and where the prediction puts them. Entry i of each list belongs to
// keypoint i.
struct ViewFeatures {
  View view;
  Descriptors descriptors;              // may be empty where only geometry is needed
  std::vector<Eigen::Vector2f> pixels;  // original pixels
  std::vector<Eigen::Vector2f> rays;    // (x/z, y/z) in the camera; NaN where there is none
  std::vector<float> scales;            // pixels; 0 where the extractor gave none
  std::vector<float> depths;            // predicted z-depth, static scene only; NaN = unknown
  std::vector<float> depth_confs;       // the producer's; 0 where depth is unknown

  size_t size() const { return pixels.size(); }
  // Predicted place of a keypoint in the world; NaN where depth is unknown.
  Eigen::Vector3d PointInWorld(size_t idx) const;
};

// `static_view` gives the depths; without it (nullptr) all are unknown. Depths of keypoints whose
// confidence is below the threshold are unknown. `view` is the view of the database's image: its
// camera may differ from the prediction's, and depth, being along z, holds in both.
// Throws std::invalid_argument if keypoints and descriptors disagree in number.
ViewFeatures MakeViewFeatures(const View& view,
                              Features features,
                              const StaticView* static_view,
                              double confidence_threshold = 0.0);

}  // namespace vgtw
