// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_stream.h"

#include "scene/error.h"
#include "scene/scene_stream_distractors.h"
#include "scene/scene_stream_renderer.h"

#include <optional>
#include <string>

namespace vgtw {
namespace {

constexpr uint64_t kPhotographKey = 0x5ce4f;

void CheckRange(double value, double min, double max, const std::string& name) {
  VGTW_CHECK(value >= min && value <= max,
             "SceneStreamOptions::" + name + " = " + std::to_string(value) + ", must be in [" +
                 std::to_string(min) + ", " + std::to_string(max) + "]");
}

double DistractorCover(const std::vector<SeenView>& views) {
  size_t num_distractor = 0;
  size_t num_pixels = 0;
  for (const SeenView& view : views) {
    for (const int32_t piece : view.hits.index.data()) {
      num_distractor += piece >= static_cast<int32_t>(view.num_static) ? 1 : 0;
    }
    num_pixels += view.hits.index.size();
  }
  return static_cast<double>(num_distractor) / static_cast<double>(num_pixels);
}

// The coarse pixels by which the scene was made may have erred.
bool IsWithinLaws(const std::vector<SeenView>& views, bool has_distractors) {
  for (const SeenView& view : views) {
    for (const int32_t piece : view.static_hits.index.data()) {
      if (piece < 0) return false;
    }
  }
  const double cover = DistractorCover(views);
  return !has_distractors || (cover >= kMinDistractorCover && cover <= kMaxDistractorCover);
}

DistractorMask ToMask(const SeenView& seen) {
  const Grid<int32_t>& pieces = seen.hits.index;
  DistractorMask distractor(pieces.width(), pieces.height());
  for (int y = 0; y < pieces.height(); ++y) {
    for (int x = 0; x < pieces.width(); ++x) {
      distractor(x, y) = seen.ShowsDistractor(x, y) ? 1.0f : 0.0f;
    }
  }
  return distractor;
}

}  // namespace

struct SceneStream::Impl {
  SceneStreamOptions options;
  std::vector<PhotoTexture> photos;

  std::optional<SceneSample> Try(uint64_t idx, uint64_t attempt) const {
    const auto world = MakeStreamWorld(options, photos, idx, attempt);
    if (!world) return std::nullopt;
    std::vector<SeenView> views;
    bool has_distractors = false;
    for (size_t i = 0; i < world->views.size(); ++i) {
      views.push_back(SeeView(*world, i));
      has_distractors = has_distractors || !world->distractors[i].pieces.empty();
    }
    if (!IsWithinLaws(views, has_distractors)) return std::nullopt;
    SceneSample sample;
    for (size_t i = 0; i < views.size(); ++i) {
      RandomStream random(HashKey({kPhotographKey, options.seed, idx, i}));
      sample.images.push_back(Photograph(PaintView(*world, views[i]), random));
      sample.distractor.push_back(ToMask(views[i]));
      sample.depth.push_back(std::move(views[i].hits.depth));
      sample.static_depth.push_back(std::move(views[i].static_hits.depth));
      sample.cameras.push_back(world->views[i].camera);
      sample.cam_from_world.push_back(world->views[i].cam_from_world);
    }
    return sample;
  }
};

void SceneStreamOptions::Check() const {
  CheckRange(width, 16, 4096, "width");
  CheckRange(height, 16, 4096, "height");
  CheckRange(min_views, 2, 64, "min_views");
  CheckRange(max_views, min_views, 64, "max_views");
  CheckRange(distractor_share, 0.0, 1.0, "distractor_share");
  constexpr uint32_t kBodies = kPersonDistractors | kCarDistractors | kThingDistractors;
  constexpr uint32_t kWays =
      kMovingDistractors | kAbsentDistractors | kDeformingDistractors | kOccludingDistractors;
  VGTW_CHECK((distractor_kinds & kBodies) != 0 && (distractor_kinds & kWays) != 0,
             "SceneStreamOptions::distractor_kinds = " + std::to_string(distractor_kinds) +
                 ", must have a body and a way");
}

SceneStream::SceneStream(const SceneStreamOptions& options) {
  options.Check();
  impl_ = std::make_unique<Impl>();
  impl_->options = options;
  if (!options.texture_folder.empty()) impl_->photos = ReadPhotoTextures(options.texture_folder);
}

SceneStream::~SceneStream() = default;
SceneStream::SceneStream(SceneStream&&) noexcept = default;
SceneStream& SceneStream::operator=(SceneStream&&) noexcept = default;

const SceneStreamOptions& SceneStream::options() const { return impl_->options; }

SceneSample SceneStream::Sample(uint64_t idx) const {
  // Most attempts succeed.
  for (uint64_t attempt = 0;; ++attempt) {
    if (auto sample = impl_->Try(idx, attempt)) return std::move(*sample);
  }
}

}  // namespace vgtw
