// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/grid.h"
#include "scene/view.h"

#include <optional>

#include <Eigen/Core>

namespace vgtw {

// z-depth in scene units, [H,W] in network pixels; NaN = unknown.
using DepthMap = Grid<float>;

// The producer's confidence, larger is better, no fixed range; [H,W] in network pixels.
using ConfidenceMap = Grid<float>;

// Bilinear depth at a network pixel; nullopt outside, next to unknown depth, or where the four
// neighbours differ by more than `max_relative_step` (a depth edge has no depth in between).
std::optional<double> SampleDepth(const DepthMap& depth,
                                  const Eigen::Vector2d& pixel_in_network,
                                  double max_relative_step = 0.05);

// World point of the centre of network pixel (x, y) at its depth; nullopt if unknown.
std::optional<Eigen::Vector3d> UnprojectPixel(const View& view,
                                              const DepthMap& depth,
                                              int x,
                                              int y);

// z-depths of world points [H,W] in the view's camera; unknown where a point is or lies behind it.
DepthMap DepthFromPoints(const View& view, const Grid<Eigen::Vector3f>& points);

}  // namespace vgtw
