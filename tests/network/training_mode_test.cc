// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_mode.h"

#include "network/trained_parameters.h"
#include "network/vggt.h"
#include "tests/network/tiny_training.h"

#include <vector>

#include <ATen/ATen.h>
#include <gtest/gtest.h>
#include <torch/csrc/autograd/autograd.h>

namespace vgtw {
namespace {

VggtConfig WithLora() {
  VggtConfig config = TrainableSizes();
  config.lora = LoraConfig{.rank = 2};
  config.has_distractor_head = true;
  return config;
}

// Gradients of a loss over the trunk's tokens, of LoRA alone.
std::vector<at::Tensor> GradientsIn(const TrainingMode& mode, double& loss) {
  const TrainedParameters parameters({NetworkKind::kVgtw, WithLora()},
                                     nullptr,
                                     TrainedParts::kLoraAndDistractorHead,
                                     3,
                                     at::Device(at::kCPU));
  // A LoRA whose B is not zero: else A has no gradient.
  for (const TrainedParameter& parameter : parameters.all()) {
    if (parameter.name.find("lora_B") != std::string::npos) {
      at::Tensor(parameter.value).fill_(0.3);
    }
  }
  LeafSource leaves(parameters);
  const Vggt model(ParameterScope(leaves), WithLora());
  const at::Tensor images = at::linspace(0.0, 1.0, 2 * 3 * 28 * 42).view({2, 3, 28, 42});
  const TrainingModeScope scope(mode);
  const at::Tensor value = model.Encode(images, {}).last.square().mean();
  torch::autograd::backward({value}, {});
  loss = value.item<double>();
  std::vector<at::Tensor> gradients;
  for (const at::Tensor& leaf : leaves.leaves()) {
    if (leaf.requires_grad() && leaf.grad().defined()) gradients.push_back(leaf.grad());
  }
  return gradients;
}

class RecomputedBlocks : public testing::TestWithParam<double> {};

TEST_P(RecomputedBlocks, HaveTheSameGradients) {
  TrainingMode mode{.lora_dropout = GetParam(), .dropout_seed = 5};
  double plain_loss = 0.0;
  const std::vector<at::Tensor> plain = GradientsIn(mode, plain_loss);
  mode.recompute_blocks = true;
  double recomputed_loss = 0.0;
  const std::vector<at::Tensor> recomputed = GradientsIn(mode, recomputed_loss);
  EXPECT_EQ(plain_loss, recomputed_loss);
  ASSERT_EQ(plain.size(), 4 * 2 * 4u);  // layers, blocks, and A and B of queries and values
  ASSERT_EQ(recomputed.size(), plain.size());
  for (size_t i = 0; i < plain.size(); ++i) {
    EXPECT_GT(plain[i].abs().max().item<double>(), 0.0);
    EXPECT_TRUE(at::allclose(plain[i], recomputed[i], 1e-5, 1e-9)) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Dropout, RecomputedBlocks, testing::Values(0.0, 0.5));

TEST(Dropout, IsAFunctionOfTheSeed) {
  double first = 0.0, same = 0.0, other = 0.0, none = 0.0;
  GradientsIn({.lora_dropout = 0.5, .dropout_seed = 5}, first);
  GradientsIn({.lora_dropout = 0.5, .dropout_seed = 5}, same);
  GradientsIn({.lora_dropout = 0.5, .dropout_seed = 6}, other);
  GradientsIn({}, none);
  EXPECT_EQ(first, same);
  EXPECT_NE(first, other);
  EXPECT_NE(first, none);
}

TEST(Dropout, KeepsTheMean) {
  const at::Tensor ones = at::ones({400, 400});
  const TrainingModeScope scope({.lora_dropout = 0.25, .dropout_seed = 1});
  const at::Tensor dropped = DropLoraInputs(ones);
  // 160,000 draws: sigma of the mean is 0.0014.
  EXPECT_NEAR(dropped.mean().item<double>(), 1.0, 0.006);
  EXPECT_NEAR((dropped == 0.0).to(at::kDouble).mean().item<double>(), 0.25, 0.006);
  EXPECT_FALSE(at::equal(dropped, DropLoraInputs(ones)));
}

TEST(Dropout, IsNoneWithoutAMode) {
  const at::Tensor ones = at::ones({4});
  {
    const TrainingModeScope outer({.lora_dropout = 0.9});
    const TrainingModeScope inner({});
    EXPECT_TRUE(DropLoraInputs(ones).is_same(ones));
  }
  EXPECT_TRUE(DropLoraInputs(ones).is_same(ones));
}

}  // namespace
}  // namespace vgtw
