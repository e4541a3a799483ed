// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/rigid3d.h"

#include <cstddef>
#include <string>
#include <vector>

namespace vgtw {

// One image as the gauge sees it.
struct GaugeImage {
  std::string name;
  Rigid3d cam_from_world;
  size_t num_observations = 0;
  size_t component = 0;  // images of one component are linked by common points
  bool is_held = false;  // its pose is constant for another reason
};

// What is held of the poses so that no direction of the solution is free.
struct Gauge {
  std::vector<bool> is_held;          // per image: the whole pose
  std::vector<int> held_coordinates;  // per image: index into the translation, -1 = none
  std::string description;
};

// Moving all of a component's cameras and points by a similarity changes no residual: 7 directions.
// Holding the pose of one image a leaves the scale s about its centre c_a, along which another
// image's translation moves as  dt/ds = t + R c_a  (the vector from centre to centre, in its
// frame). Holding the largest coordinate of that vector's translation therefore removes the last
// one. Per component: a = a held image, else the one with most observations; the other is the free
// image farthest from it. Nothing is added where two held images with a baseline fix the scale, nor
// where all centres coincide (the scale then has no effect on the poses).
Gauge ChooseGauge(const std::vector<GaugeImage>& images);

}  // namespace vgtw
