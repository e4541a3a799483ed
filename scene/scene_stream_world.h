// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/scene_stream.h"
#include "scene/scene_stream_cameras.h"
#include "scene/scene_stream_distractors.h"
#include "scene/scene_stream_stage.h"

#include <optional>
#include <vector>

namespace vgtw {

// Light of a scene: the same from everywhere, and two lamps at infinity.
struct Lighting {
  Eigen::Vector3f ambient = Eigen::Vector3f::Constant(0.5f);
  struct Lamp {
    Eigen::Vector3f colour = Eigen::Vector3f::Zero();
    Eigen::Vector3f direction = Eigen::Vector3f::UnitZ();  // towards the lamp, unit
  };
  Lamp sun;
  Lamp fill;
};

struct StreamWorld {
  Stage stage;
  std::vector<StreamView> views;
  std::vector<Actors> distractors;  // by view
  Lighting lighting;
};

// The geometry of sample `idx`; nullopt where this attempt's cameras or distractors do not work out
// and the next attempt has to be taken.
std::optional<StreamWorld> MakeStreamWorld(const SceneStreamOptions& options,
                                           const std::vector<PhotoTexture>& photos,
                                           uint64_t idx,
                                           uint64_t attempt);

}  // namespace vgtw
