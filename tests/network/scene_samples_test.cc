// SPDX-License-Identifier: BSD-3-Clause
#include "network/scene_samples.h"

#include "network/camera_geometry.h"

#include <cmath>
#include <thread>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

SceneStreamOptions Small() {
  SceneStreamOptions options;
  options.width = 56;
  options.height = 42;
  options.min_views = 2;
  options.max_views = 4;
  return options;
}

// How far the static points of view 0 lie from the surfaces of view 1 that they meet, relative to
// their depth: median over pixels. Pixels between two depths make it more than nothing.
double MedianMisfit(const TrainingSample& sample) {
  const GeometryTruth& truth = sample.truth;
  const at::Tensor world = Unproject(truth.depth, {truth.cam_from_world, truth.intrinsics})[0];
  const at::Tensor pose = truth.cam_from_world[1];
  const at::Tensor local =
      at::matmul(world, pose.slice(1, 0, 3).t()) + pose.select(1, 3);  // [H, W, 3]
  const at::Tensor z = local.select(2, 2);
  const at::Tensor pixels = at::matmul(local / z.unsqueeze(2), truth.intrinsics[1].t());
  const int64_t height = z.size(0), width = z.size(1);
  const at::Tensor x = pixels.select(2, 0).round().to(at::kLong);
  const at::Tensor y = pixels.select(2, 1).round().to(at::kLong);
  const at::Tensor inside = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (z > 0.0) &
                            (sample.distractor[0] < 0.5) & truth.depth[0].isfinite();
  const at::Tensor there = truth.depth[1].index({y.masked_select(inside), x.masked_select(inside)});
  const at::Tensor distractor =
      sample.distractor[1].index({y.masked_select(inside), x.masked_select(inside)});
  const at::Tensor misfit = ((there - z.masked_select(inside)) / there).abs();
  const at::Tensor counted = misfit.masked_select((distractor < 0.5) & there.isfinite());
  return counted.numel() > 50 ? counted.median().item<double>() : 0.0;
}

TEST(SceneSamples, GeometryIsConsistentBetweenViews) {
  const SceneSamples samples(Small(), SceneKind::kVaried);
  for (uint64_t idx = 0; idx < 8; ++idx) {
    // Neighbouring pixels of 56 x 42 differ in depth by about 2 %; wrong poses give tens.
    EXPECT_LT(MedianMisfit(samples.Get(idx)), 0.03) << idx;
  }
}

TEST(SceneSamples, AreAFunctionOfTheIndex) {
  const SceneSamples samples(Small(), SceneKind::kVaried);
  TrainingSample other;
  std::thread thread([&] { other = samples.Get(5); });
  const TrainingSample sample = samples.Get(5);
  thread.join();
  EXPECT_TRUE(at::equal(sample.images, other.images));
  EXPECT_TRUE(at::equal(sample.distractor, other.distractor));
  EXPECT_TRUE(at::equal(sample.truth.cam_from_world, other.truth.cam_from_world));
  EXPECT_GE(sample.images.min().item<double>(), 0.0);
  EXPECT_LE(sample.images.max().item<double>(), 1.0);
  EXPECT_GT(sample.images.std().item<double>(), 0.01);
}

TEST(SceneSamples, SkyHasNoDepth) {
  const SceneSamples samples(Small(), SceneKind::kVaried);
  bool has_unknown = false;
  for (uint64_t idx = 0; idx < 16; ++idx) {
    const at::Tensor depth = samples.Get(idx).truth.depth;
    has_unknown = has_unknown || depth.isnan().any().item<bool>();
    EXPECT_LE(at::nan_to_num(depth, 0.0).max().item<double>(), 60.0);
  }
  EXPECT_TRUE(has_unknown);
}

}  // namespace
}  // namespace vgtw
