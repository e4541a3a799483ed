// SPDX-License-Identifier: BSD-3-Clause
#include "scene/demo_scenes.h"

#include "scene/random.h"
#include "scene/synthetic.h"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

namespace vgtw {
namespace {

constexpr uint64_t kKey = 0x64656d6f;           // of choices that no other source of samples makes
constexpr uint64_t kNotOfTheDemo = 1ull << 63;  // the demo's seeds are small

SyntheticOptions DrawOptions(const SceneStreamOptions& options, RandomStream& random) {
  SyntheticOptions scene;
  scene.num_views = std::max(8 + static_cast<int>(random.Index(9)), options.max_views);
  scene.path_extent_deg = random.Uniform(60.0, 120.0);
  scene.width = options.width;
  scene.height = options.height;
  const bool has_distractors = random.Chance(options.distractor_share);
  const int num_distractors = 1 + static_cast<int>(random.Index(5));
  scene.num_distractors = has_distractors ? num_distractors : 0;
  scene.distractor_size = random.Uniform(0.7, 1.3);
  scene.num_threads = 1;
  scene.seed = random.Bits() | kNotOfTheDemo;
  return scene;
}

// `num` of the numbers below `num_all`, rising.
std::vector<size_t> DrawViews(int num_all, size_t num, RandomStream& random) {
  std::vector<size_t> views(static_cast<size_t>(num_all));
  std::iota(views.begin(), views.end(), size_t{0});
  for (size_t i = 0; i < num; ++i) std::swap(views[i], views[i + random.Index(views.size() - i)]);
  views.resize(num);
  std::sort(views.begin(), views.end());
  return views;
}

}  // namespace

SceneSample SampleDemoScene(const SceneStreamOptions& options, uint64_t idx) {
  RandomStream random(HashKey({options.seed, idx, kKey}));
  const SyntheticScene scene(DrawOptions(options, random));
  const size_t num_choices = static_cast<size_t>(options.max_views - options.min_views + 1);
  const size_t num_views = static_cast<size_t>(options.min_views) + random.Index(num_choices);
  SceneSample sample;
  for (const size_t i : DrawViews(scene.options().num_views, num_views, random)) {
    SyntheticView view = scene.Render(i);
    sample.images.push_back(std::move(view.image));
    sample.depth.push_back(std::move(view.depth));
    sample.static_depth.push_back(std::move(view.static_depth));
    sample.distractor.push_back(std::move(view.distractor));
    sample.cameras.push_back(scene.views()[i].camera);
    sample.cam_from_world.push_back(scene.views()[i].cam_from_world);
  }
  return sample;
}

}  // namespace vgtw
