// SPDX-License-Identifier: BSD-3-Clause
// Training needs gradients through the whole network: derivatives of a loss over all outputs along
// random directions of the parameters, against differences, in double precision.
#include "network/vggt.h"

#include "tests/network/tiny_network.h"
#include "tests/parity/parity_formula.h"

#include <cmath>
#include <map>

#include <ATen/ATen.h>
#include <gtest/gtest.h>
#include <torch/csrc/autograd/autograd.h>

namespace vgtw {
namespace {

at::Tensor Formula(const std::string& name, const Shape& shape) {
  return at::tensor(ParityWeights(name, shape)).view(shape);
}

class LeafSource : public ParameterSource {
 public:
  at::Tensor Get(const std::string& name, const Shape& shape, at::ScalarType) override {
    at::Tensor leaf = Formula(name, shape).to(at::kDouble).requires_grad_();
    leaves[name] = leaf;
    return leaf;
  }
  std::map<std::string, at::Tensor> leaves;
};

VggtConfig TrainableVgtw() {
  VggtConfig config = TinyVgtw(16);
  config.num_camera_heads = 2;
  config.lora->alpha = 1.0;
  return config;
}

at::Tensor Loss(const Vggt& network, const at::Tensor& images) {
  const Features features = network.Encode(images, {});
  const CameraOutputs cameras = network.PredictCameras(features);
  const DenseOutputs maps = network.PredictMaps(features, 0, features.num_views(), {});
  at::Tensor loss = cameras.pose_encodings[0].square().mean();
  loss = loss + maps.depth.log().square().mean() + maps.depth_conf.log().mean();
  loss = loss + maps.points.square().mean() + maps.points_conf.log().mean();
  return loss + at::softplus(maps.distractor_logits).mean();
}

TEST(Gradient, MatchesDifferencesAlongEveryKindOfParameter) {
  LeafSource source;
  const Vggt network(ParameterScope(source), TrainableVgtw());
  const at::Tensor images =
      at::tensor(ParityPixels("images.gradient", 2, 28, 42)).view({2, 3, 28, 42}).to(at::kDouble) /
      255.0;
  Loss(network, images).backward();
  for (const std::string name : {"aggregator.patch_embed.pos_embed",
                                 "aggregator.patch_embed.blocks.0.attn.qkv.weight",
                                 "aggregator.camera_token",
                                 "aggregator.frame_blocks.0.attn.lora_A_q",
                                 "aggregator.global_blocks.1.attn.lora_B_v",
                                 "aggregator.global_blocks.2.attn.q_norm.weight",
                                 "aggregator.frame_blocks.3.mlp.fc1.weight",
                                 "camera_head.trunk.3.attn.proj.weight",
                                 "depth_head.scratch.refinenet4.resConfUnit2.conv1.weight",
                                 "point_head.resize_layers.0.weight",
                                 "mask_head.scratch.output_conv2.2.weight"}) {
    at::Tensor& leaf = source.leaves.at(name);
    ASSERT_TRUE(leaf.grad().defined()) << name;
    const at::Tensor direction = leaf.grad() / leaf.grad().norm();
    const double slope = leaf.grad().norm().item<double>();
    const double step = 1e-7;
    const auto loss_at = [&](double distance) {
      const at::NoGradGuard no_gradient;
      leaf.add_(direction, distance);
      const double loss = Loss(network, images).item<double>();
      leaf.sub_(direction, distance);
      return loss;
    };
    const double difference = (loss_at(step) - loss_at(-step)) / (2.0 * step);
    // Rounding of a loss near 10 in double precision over the step: 1e-15 / 1e-7.
    EXPECT_NEAR(difference, slope, 1e-6 * slope + 2e-8) << name;
  }
}

// Frozen parameters get none, and what feeds back the raw pose is detached.
TEST(Gradient, StopsWhereTheOfficialNetworkStopsIt) {
  LeafSource source;
  const Vggt network(ParameterScope(source), TrainableVgtw());
  const at::Tensor images =
      at::tensor(ParityPixels("images.gradient", 1, 28, 28)).view({1, 3, 28, 28}).to(at::kDouble) /
      255.0;
  const Features features = network.Encode(images, {});
  network.PredictCameras(features).pose_encodings.sum().backward();
  EXPECT_FALSE(source.leaves.at("mask_head.projects.0.weight").grad().defined());
  EXPECT_FALSE(source.leaves.at("aggregator.patch_embed.mask_token").grad().defined());
  EXPECT_TRUE(source.leaves.at("camera_head.empty_pose_tokens").grad().defined());
}

}  // namespace
}  // namespace vgtw
