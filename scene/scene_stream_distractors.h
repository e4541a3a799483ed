// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/scene_stream_cameras.h"
#include "scene/scene_stream_stage.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace vgtw {

// Bounds of the share of a scene's pixels, all views together, that show distractors.
inline constexpr double kMinDistractorCover = 0.02;
inline constexpr double kMaxDistractorCover = 0.35;

// The distractors of one view.
struct Actors {
  std::vector<Piece> pieces;
  std::vector<Footprint> footprints;  // of those that stand on the floor
};

// Puts members of the cast into the views, by the ways that `kinds` (bits of DistractorKind)
// allows, until they cover a drawn share of the coarse pixels. By view; nullopt if the share
// cannot be brought within the bounds.
std::optional<std::vector<Actors>> DrawDistractors(const Stage& stage,
                                                   const std::vector<StreamView>& views,
                                                   const std::vector<CastMember>& cast,
                                                   uint32_t kinds,
                                                   RandomStream& random);

}  // namespace vgtw
