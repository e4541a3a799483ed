// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/scene_stream.h"

#include <cstdint>

namespace vgtw {

// A few views of a scene of the kind that `vgtw demo` renders (scene/synthetic.h), for training:
// 8 to 16 cameras on an arc of 60 to 120 degrees around the middle of a room, of which some are
// drawn, in the order of the path. A narrower world than SceneStream's: one room, one lens, one
// kind of path, so that small networks learn it in hours. Of the options, sizes, numbers of views,
// distractor_share and seed count. Law: a function of them and idx alone; seeds of the demo (up to
// 2^32) do not occur. Throws std::invalid_argument if the sizes are below 32 pixels.
SceneSample SampleDemoScene(const SceneStreamOptions& options, uint64_t idx);

}  // namespace vgtw
