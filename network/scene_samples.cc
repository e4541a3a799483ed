// SPDX-License-Identifier: BSD-3-Clause
#include "network/scene_samples.h"

#include "network/config.h"
#include "network/grid_tensors.h"
#include "scene/demo_scenes.h"
#include "scene/error.h"
#include "scene/random.h"

#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <ATen/ATen.h>

namespace vgtw {
namespace {

constexpr float kSkyDepth = 60.0f;  // the stream's dome is farther, everything else nearer

at::Tensor ToTensor(const Rigid3d& cam_from_world) {
  const Eigen::Matrix3d rotation = cam_from_world.rotation.toRotationMatrix();
  const at::Tensor matrix = at::empty({3, 4}, at::kFloat);
  auto values = matrix.accessor<float, 2>();
  for (int64_t row = 0; row < 3; ++row) {
    for (int64_t column = 0; column < 3; ++column) {
      values[row][column] = static_cast<float>(rotation(row, column));
    }
    values[row][3] = static_cast<float>(cam_from_world.translation[row]);
  }
  return matrix;
}

// The principal point is where the networks take it to be.
at::Tensor Intrinsics(const Camera& camera) {
  const at::Tensor matrix = at::eye(3, at::kFloat);
  matrix[0][0] = camera.FocalLengthX();
  matrix[1][1] = camera.FocalLengthY();
  matrix[0][2] = 0.5 * static_cast<double>(camera.width);
  matrix[1][2] = 0.5 * static_cast<double>(camera.height);
  return matrix;
}

std::vector<size_t> RandomOrder(size_t num_views, uint64_t key) {
  std::vector<size_t> order(num_views);
  std::iota(order.begin(), order.end(), size_t{0});
  RandomStream random(key);
  for (size_t i = num_views; i > 1; --i) std::swap(order[i - 1], order[random.Bits() % i]);
  return order;
}

}  // namespace

SceneSamples::SceneSamples(const SceneStreamOptions& options, SceneKind kind)
    : kind_(kind), stream_(options) {
  VGTW_CHECK(options.width % kPatchSize == 0 && options.height % kPatchSize == 0,
             "size of scenes " + std::to_string(options.width) + "x" +
                 std::to_string(options.height) + ", must be multiples of 14");
}

TrainingSample SceneSamples::Get(uint64_t idx) const {
  const SceneSample scene =
      kind_ == SceneKind::kDemo ? SampleDemoScene(stream_.options(), idx) : stream_.Sample(idx);
  std::vector<at::Tensor> images, distractor, depth, poses, intrinsics;
  for (const size_t view :
       RandomOrder(scene.images.size(), HashKey({stream_.options().seed, idx, 1}))) {
    images.push_back(ToTensor(scene.images[view]));
    distractor.push_back(ToTensor(scene.distractor[view]));
    depth.push_back(ToTensor(scene.depth[view]));
    poses.push_back(ToTensor(scene.cam_from_world[view]));
    intrinsics.push_back(Intrinsics(scene.cameras[view]));
  }
  TrainingSample sample;
  sample.images = at::stack(images);
  sample.distractor = at::stack(distractor);
  const at::Tensor seen = at::stack(depth);
  sample.truth.depth = seen.masked_fill(seen > kSkyDepth, std::numeric_limits<float>::quiet_NaN());
  sample.truth.cam_from_world = at::stack(poses);
  sample.truth.intrinsics = at::stack(intrinsics);
  return sample;
}

}  // namespace vgtw
