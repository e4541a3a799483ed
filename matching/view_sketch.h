// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/depth_map.h"
#include "scene/static_view.h"
#include "scene/view.h"

#include <vector>

#include <Eigen/Core>

namespace vgtw {

struct ViewSketchOptions {
  int max_points = 256;  // in [1, 65536]
  int map_size = 64;     // cells along the longer side of the map of depth; in [1, 4096]

  void Check() const;
};

// As much of a view as it takes to tell what it shares with others, in some 20 kB, so that
// thousands of views fit into memory at once.
struct ViewSketch {
  View view;
  // Confident static points in the world, at most one per cell of a regular grid over the image, so
  // that their number measures area. None if no depth is known.
  std::vector<Eigen::Vector3d> points;
  // Static depth of the whole image (not of the network's part of it) in cells of equal size: that
  // of the confident static point nearest to the middle of the cell, NaN if there is none. Coarser
  // than `map_size` where depth is known for few pixels only; empty if there are no points.
  DepthMap depth;
};

// Points are those of StaticView::StaticPoints; what is not finite, behind the camera or outside
// the image is left out. Throws std::invalid_argument if the camera has a fault.
ViewSketch MakeViewSketch(const StaticView& view,
                          double confidence_threshold,
                          const ViewSketchOptions& options = {});

}  // namespace vgtw
