// SPDX-License-Identifier: BSD-3-Clause
#include "network/trained_parameters.h"

#include "network/vggt.h"
#include "tests/network/tiny_training.h"
#include "tests/parity/parity_fixture.h"
#include "tests/support/shared_data.h"

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

NetworkDescription Extended() {
  NetworkDescription network = TrainableNetwork();
  auto& config = std::get<VggtConfig>(network.config);
  config.lora = LoraConfig{.rank = 2};
  config.has_distractor_head = true;
  network.kind = NetworkKind::kVgtw;
  return network;
}

TrainedParameters Make(const NetworkDescription& network, TrainedParts parts) {
  return {network, nullptr, parts, 7, at::Device(at::kCPU)};
}

TEST(TrainedParameters, FreshLoraChangesNothing) {
  const TrainedParameters base = Make(TrainableNetwork(), TrainedParts::kAll);
  const TrainedParameters extended = Make(Extended(), TrainedParts::kLoraAndDistractorHead);
  LeafSource base_leaves(base);
  LeafSource extended_leaves(extended);
  const Vggt base_model(ParameterScope(base_leaves), TrainableSizes());
  const Vggt extended_model(ParameterScope(extended_leaves),
                            std::get<VggtConfig>(Extended().config));
  const at::Tensor images = at::linspace(0.0, 1.0, 2 * 3 * 28 * 42).view({2, 3, 28, 42});
  EXPECT_TRUE(
      at::equal(base_model.Encode(images, {}).last, extended_model.Encode(images, {}).last));
}

TEST(TrainedParameters, OfTheExtensionAreLoraAndDistractorHead) {
  const TrainedParameters parameters = Make(Extended(), TrainedParts::kLoraAndDistractorHead);
  int64_t num_lora = 0;
  for (const TrainedParameter& parameter : parameters.all()) {
    const bool is_lora = parameter.name.find(".attn.lora_") != std::string::npos;
    const bool is_head = parameter.name.starts_with("mask_head.");
    EXPECT_EQ(parameter.is_trained, is_lora || is_head) << parameter.name;
    if (is_lora) num_lora += parameter.value.numel();
    EXPECT_FALSE(is_lora && parameter.decays) << parameter.name;
  }
  EXPECT_EQ(num_lora, 2 * 4 * 4 * 2 * 16);  // kinds of blocks, depth, matrices, rank, channels
}

std::vector<ListingSource::Row> PublishedSizes() {
  VggtConfig config;
  config.lora = LoraConfig{};
  config.has_distractor_head = true;
  ListingSource listing;
  const Vggt model(ParameterScope(listing), config);
  return listing.rows();
}

// 6,291,456 numbers of LoRA and 32,671,041 of the head, as in the paper's checkpoint.
TEST(TrainedParameters, OfThePublishedSizesAreAsManyAsInTheCheckpoint) {
  int64_t num_lora = 0;
  int64_t num_head = 0;
  for (const ListingSource::Row& row : PublishedSizes()) {
    const int64_t num = c10::multiply_integers(row.shape);
    if (GroupOf(row.name) == ParameterGroup::kLora) num_lora += num;
    if (GroupOf(row.name) == ParameterGroup::kDistractorHead) num_head += num;
  }
  EXPECT_EQ(num_lora, 6291456);
  EXPECT_EQ(num_head, 32671041);
}

// So that a file of LoRA and head loads over VGGT-1B, here and in the official code.
TEST(TrainedParameters, OfThePublishedSizesAreWhatVgtwHasAndVggtHasNot) {
  VGTW_NEED_PARITY_DATA();
  auto expected = ReadParityShapes(ParityData() / "state_dict.VGTW-LoRA.txt");
  for (const auto& [name, shape] : ReadParityShapes(ParityData() / "state_dict.VGGT-1B.txt")) {
    EXPECT_EQ(expected.erase(name), 1u) << name;
  }
  std::map<std::string, Shape> trained;
  for (const ListingSource::Row& row : PublishedSizes()) {
    const ParameterGroup group = GroupOf(row.name);
    if (group == ParameterGroup::kLora || group == ParameterGroup::kDistractorHead) {
      trained[row.name] = row.shape;
    }
  }
  EXPECT_EQ(trained, expected);
}

TEST(TrainedParameters, OfANewNetworkAreAll) {
  const TrainedParameters parameters = Make(TrainableNetwork(), TrainedParts::kAll);
  int64_t num = 0;
  for (const TrainedParameter& parameter : parameters.all()) num += parameter.value.numel();
  EXPECT_EQ(parameters.NumTrained(), num);
}

TEST(FreshValue, IsAFunctionOfNameAndSeed) {
  const Shape shape = {6, 5};
  EXPECT_TRUE(at::equal(FreshValue("a.weight", shape, 1), FreshValue("a.weight", shape, 1)));
  EXPECT_FALSE(at::equal(FreshValue("a.weight", shape, 1), FreshValue("b.weight", shape, 1)));
  EXPECT_FALSE(at::equal(FreshValue("a.weight", shape, 1), FreshValue("a.weight", shape, 2)));
}

TEST(FreshValue, HasTheSpreadOfItsKind) {
  const auto deviation = [](const char* name, const Shape& shape) {
    return FreshValue(name, shape, 3).std().item<double>();
  };
  // Uniform in +-a has the deviation a / sqrt(3).
  EXPECT_NEAR(deviation("fc1.weight", {200, 100}), std::sqrt(6.0 / 300.0 / 3.0), 2e-3);
  EXPECT_NEAR(deviation("conv.weight", {64, 32, 3, 3}), 1.0 / std::sqrt(3.0 * 288.0), 1e-3);
  EXPECT_NEAR(deviation("x.attn.lora_A_q", {32, 1024}), 1.0 / std::sqrt(3.0 * 1024.0), 1e-3);
  EXPECT_NEAR(deviation("aggregator.camera_token", {1, 2, 1, 4096}), 0.02, 1e-3);
  EXPECT_EQ(FreshValue("x.attn.lora_B_q", {8, 4}, 1).abs().max().item<double>(), 0.0);
  EXPECT_TRUE(at::equal(FreshValue("norm.weight", {3}, 1), at::ones({3})));
  EXPECT_TRUE(at::equal(FreshValue("norm.bias", {3}, 1), at::zeros({3})));
}

TEST(FreshValue, FirstGuessOfACameraIsTheIdentity) {
  const at::Tensor after_four_steps = 4.0 * FreshValue("camera_head.pose_branch.fc2.bias", {9}, 1);
  EXPECT_TRUE(
      at::equal(after_four_steps, at::tensor({0., 0., 0., 0., 0., 0., 1., 1., 1.}).to(at::kFloat)));
}

TEST(LeafSource, SharesValuesAndKeepsGradientsApart) {
  const TrainedParameters parameters = Make(TrainableNetwork(), TrainedParts::kAll);
  LeafSource one(parameters);
  LeafSource two(parameters);
  one.leaves()[0].sum().backward();
  EXPECT_TRUE(one.leaves()[0].grad().defined());
  EXPECT_FALSE(two.leaves()[0].grad().defined());
  at::Tensor(parameters.all()[0].value).fill_(2.0);
  EXPECT_EQ(two.leaves()[0].max().item<double>(), 2.0);
  one.ClearGradients();
  EXPECT_FALSE(one.leaves()[0].grad().defined());
}

}  // namespace
}  // namespace vgtw
