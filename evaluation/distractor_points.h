// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/distractor_mask.h"
#include "scene/reconstruction.h"

#include <cstddef>
#include <functional>
#include <map>
#include <string>

namespace vgtw {

// How much of a model rests on distractors, judged by true masks.
struct DistractorCount {
  size_t num_observations = 0;                          // that lie in an excluded pixel
  size_t num_points3D = 0;                              // with at least one such observation
  std::map<ImageId, size_t> num_observations_by_image;  // of all images
};

// `true_mask` gives the mask of an image by name; it is called once per image.
DistractorCount CountOnDistractors(const Reconstruction& reconstruction,
                                   const std::function<StaticMask(const std::string&)>& true_mask);

}  // namespace vgtw
