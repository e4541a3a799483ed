// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/synthetic.h"
#include "scene/synthetic_geometry.h"

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace vgtw {

// Streams of random numbers that must not influence each other: another number of views or of
// distractors leaves the furniture as it is.
enum SyntheticStream : uint64_t {
  kFurnitureStream = 1,
  kTextureStream,
  kMoverStream,
  kMoverTextureStream,
  kAbsenceStream,
  kExposureStream,
  kNoiseStream
};

// Geometry of a synthetic scene: a square room around the origin, z up, floor at z = 0, furniture
// in the middle and along the walls, cameras between the two, movers between cameras and middle.
struct SyntheticWorld {
  std::vector<View> views;
  std::vector<Shape> static_shapes;
  std::vector<std::vector<Shape>> distractor_shapes;  // by view
};

SyntheticWorld MakeSyntheticWorld(const SyntheticOptions& options);

// The ray through a pixel, in the world, with direction of camera z 1 (so that depth is z-depth);
// nullopt where the distortion has no inverse.
std::optional<Ray> PixelRay(const View& view, const Eigen::Vector2d& pixel);

}  // namespace vgtw
