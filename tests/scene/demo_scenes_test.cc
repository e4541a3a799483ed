// SPDX-License-Identifier: BSD-3-Clause
#include "scene/demo_scenes.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

SceneStreamOptions Small() {
  SceneStreamOptions options;
  options.width = 56;
  options.height = 42;
  options.min_views = 2;
  options.max_views = 5;
  return options;
}

bool HasDistractor(const SceneSample& sample) {
  return std::any_of(sample.distractor.begin(), sample.distractor.end(), [](const auto& mask) {
    return std::any_of(mask.data().begin(), mask.data().end(), [](float p) { return p > 0.5f; });
  });
}

TEST(DemoScenes, AreAFunctionOfOptionsAndIndex) {
  const SceneSample sample = SampleDemoScene(Small(), 3);
  const SceneSample again = SampleDemoScene(Small(), 3);
  ASSERT_EQ(sample.images.size(), again.images.size());
  EXPECT_EQ(sample.images[0].data(), again.images[0].data());
  SceneStreamOptions other = Small();
  other.seed = 1;
  EXPECT_NE(sample.images[0].data(), SampleDemoScene(other, 3).images[0].data());
  EXPECT_NE(sample.images[0].data(), SampleDemoScene(Small(), 4).images[0].data());
}

TEST(DemoScenes, HaveTheWantedNumbersOfViewsAndDistractors) {
  SceneStreamOptions options = Small();
  options.distractor_share = 0.0;
  std::set<size_t> nums_of_views;
  for (uint64_t idx = 0; idx < 24; ++idx) {
    const SceneSample sample = SampleDemoScene(options, idx);
    nums_of_views.insert(sample.images.size());
    EXPECT_FALSE(HasDistractor(sample)) << idx;
  }
  EXPECT_EQ(nums_of_views, (std::set<size_t>{2, 3, 4, 5}));
  options.distractor_share = 1.0;
  int num_with = 0;
  for (uint64_t idx = 0; idx < 24; ++idx) num_with += HasDistractor(SampleDemoScene(options, idx));
  EXPECT_GE(num_with, 22);  // one alone may be absent from the views that were drawn
}

// Points of a view lie on the surfaces of the others that see them.
TEST(DemoScenes, GeometryIsConsistentBetweenViews) {
  SceneStreamOptions options = Small();
  options.distractor_share = 0.0;
  for (uint64_t idx = 0; idx < 4; ++idx) {
    const SceneSample sample = SampleDemoScene(options, idx);
    int num_seen = 0, num_same = 0;
    for (int y = 0; y < options.height; y += 3) {
      for (int x = 0; x < options.width; x += 3) {
        const auto ray = Unproject(sample.cameras[0], Eigen::Vector2d(x + 0.5, y + 0.5));
        ASSERT_TRUE(ray);
        const Eigen::Vector3d point = sample.cam_from_world[1] *
                                      (Inverse(sample.cam_from_world[0]) *
                                       Eigen::Vector3d(sample.depth[0](x, y) * ray->homogeneous()));
        const auto pixel = Project(sample.cameras[1], point);
        if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() >= options.width ||
            pixel->y() >= options.height) {
          continue;
        }
        const float there =
            sample.depth[1](static_cast<int>(pixel->x()), static_cast<int>(pixel->y()));
        if (point.z() > 1.1 * there) continue;  // hidden
        ++num_seen;
        num_same += std::abs(point.z() - there) < 0.1 * there;
      }
    }
    EXPECT_GT(num_seen, 20) << idx;
    EXPECT_GT(num_same, 0.9 * num_seen) << idx;
  }
}

}  // namespace
}  // namespace vgtw
