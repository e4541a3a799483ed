// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream_world.h"

#include <algorithm>
#include <cmath>

namespace vgtw {
namespace {

// The first number of every key: no stream of another kind of scene shares its keys.
constexpr uint64_t kSceneStreamKey = 0x5ce4e;

Layout DrawLayout(RandomStream& random) {
  const double place = random.Uniform();
  if (place < 0.40) return Layout::kRoom;
  if (place < 0.65) return Layout::kTable;
  if (place < 0.85) return Layout::kStreet;
  return Layout::kFacade;
}

Lighting::Lamp DrawLamp(double strength, RandomStream& random) {
  const Eigen::Vector3d tint = 0.06 * random.NormalVector();
  Eigen::Vector3d direction = random.NormalVector();
  direction.z() = std::abs(direction.z()) + 0.2;
  const Eigen::Vector3d colour = strength * (Eigen::Vector3d::Ones() + tint);
  return {colour.cast<float>(), direction.normalized().cast<float>()};
}

Lighting DrawLighting(RandomStream& random) {
  Lighting lighting;
  const Eigen::Vector3d tint = 0.04 * random.NormalVector();
  const double ambient = random.Uniform(0.35, 0.75);
  lighting.ambient = (ambient * (Eigen::Vector3d::Ones() + tint)).cast<float>();
  lighting.sun = DrawLamp(random.Uniform(0.2, 1.0) * (1.2 - ambient), random);
  lighting.fill = DrawLamp(random.Uniform(0.05, 0.25), random);
  return lighting;
}

std::vector<CastMember> DrawLookAlikes(const std::vector<CastMember>& cast,
                                       uint32_t kinds,
                                       RandomStream& random) {
  std::vector<CastMember> look_alikes;
  if ((kinds & kStaticLookAlikes) == 0) return look_alikes;
  for (const CastMember& member : cast) {
    if (random.Chance(0.6)) look_alikes.push_back(member);
  }
  return look_alikes;
}

}  // namespace

std::optional<StreamWorld> MakeStreamWorld(const SceneStreamOptions& options,
                                           const std::vector<PhotoTexture>& photos,
                                           uint64_t idx,
                                           uint64_t attempt) {
  RandomStream random(HashKey({kSceneStreamKey, options.seed, idx, attempt}));
  StreamWorld world;
  world.stage.layout = DrawLayout(random);
  const auto num_extra_views =
      random.Index(static_cast<size_t>(options.max_views - options.min_views) + 1);
  const int num_views = options.min_views + static_cast<int>(num_extra_views);
  const bool has_distractors = random.Chance(options.distractor_share);
  const std::vector<CastMember> cast =
      DrawCast(options.distractor_kinds, photos, random, world.stage);
  FurnishStage(DrawLookAlikes(cast, options.distractor_kinds, random), photos, random, world.stage);
  auto views = DrawViews(world.stage, {num_views, options.width, options.height}, random);
  if (!views) return std::nullopt;
  world.views = std::move(*views);
  world.distractors.resize(world.views.size());
  world.lighting = DrawLighting(random);
  if (!has_distractors) return world;
  auto distractors =
      DrawDistractors(world.stage, world.views, cast, options.distractor_kinds, random);
  if (!distractors) return std::nullopt;
  world.distractors = std::move(*distractors);
  return world;
}

}  // namespace vgtw
