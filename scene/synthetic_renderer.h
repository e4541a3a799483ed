// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/synthetic_world.h"

namespace vgtw {

// Depths and distractors by the ray of each pixel centre, colours as the mean of 2 x 2 rays.
SyntheticView RenderView(const SyntheticWorld& world,
                         const SyntheticOptions& options,
                         size_t view_idx);

}  // namespace vgtw
