// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_loss.h"

#include "network/scene_samples.h"
#include "network/trained_parameters.h"
#include "network/vggt.h"
#include "tests/network/tiny_training.h"

#include <array>
#include <optional>
#include <string>

#include <ATen/ATen.h>
#include <gtest/gtest.h>
#include <torch/csrc/autograd/autograd.h>

namespace vgtw {
namespace {

using Weights = std::array<double, kNumTrainingLosses>;

class SampleLossTest : public testing::Test {
 protected:
  SampleLossTest() {
    SceneStreamOptions scenes;
    scenes.width = 42;
    scenes.height = 28;
    scenes.max_views = 3;
    sample_ = SceneSamples(scenes, SceneKind::kVaried).Get(1);
    auto& config = std::get<VggtConfig>(network_.config);
    config.has_distractor_head = true;
    config.has_point_head = true;
    parameters_.emplace(network_, nullptr, TrainedParts::kAll, 1, at::Device(at::kCPU));
    leaves_.emplace(*parameters_);
    model_.emplace(ParameterScope(*leaves_), config);
  }

  SampleLoss Loss(const Weights& weights) const {
    return ComputeSampleLoss(*model_, sample_, weights, /*feature_layer=*/3);
  }

  NetworkDescription network_ = TrainableNetwork();
  TrainingSample sample_;
  std::optional<TrainedParameters> parameters_;
  std::optional<LeafSource> leaves_;
  std::optional<Vggt> model_;
};

TEST_F(SampleLossTest, IsTheWeightedSum) {
  const Weights weights = {0.2, 0.3, 0.5, 0.7, 1.1, 0.6, 0.4};
  const SampleLoss loss = Loss(weights);
  double sum = 0.0;
  for (size_t i = 0; i < kNumTrainingLosses; ++i) {
    EXPECT_NE(loss.values[i], 0.0) << kTrainingLossNames[i];
    sum += weights[i] * loss.values[i];
    Weights alone = {};
    alone[i] = 1.0;
    EXPECT_NEAR(Loss(alone).total.item<double>(), loss.values[i], 1e-5) << kTrainingLossNames[i];
  }
  EXPECT_NEAR(loss.total.item<double>(), sum, 1e-5);
}

TEST_F(SampleLossTest, OfMasksDoesNotReachOtherHeads) {
  torch::autograd::backward({Loss({1.0}).total}, {});
  for (size_t i = 0; i < parameters_->all().size(); ++i) {
    if (parameters_->all()[i].group != ParameterGroup::kHeads) continue;
    EXPECT_FALSE(leaves_->leaves()[i].grad().defined()) << parameters_->all()[i].name;
  }
}

TEST_F(SampleLossTest, WithoutGeometryIsOfMasksAlone) {
  const double mask = Loss({1.0}).values[0];
  sample_.truth = {};
  const SampleLoss loss = Loss({1.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0});
  EXPECT_EQ(loss.values[0], mask);
  for (size_t i = 3; i < kNumTrainingLosses; ++i) EXPECT_EQ(loss.values[i], 0.0);
}

// Along the gradient the loss falls as fast as the gradient says.
TEST_F(SampleLossTest, FallsAlongItsGradient) {
  const Weights weights = {0.2, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0};
  const SampleLoss loss = Loss(weights);
  torch::autograd::backward({loss.total}, {});
  double slope = 0.0;
  constexpr double kStep = 1e-4;
  const at::NoGradGuard no_gradients;
  for (size_t i = 0; i < parameters_->all().size(); ++i) {
    const at::Tensor gradient = leaves_->leaves()[i].grad();
    if (!gradient.defined()) continue;
    slope += gradient.square().sum().item<double>();
    at::Tensor(parameters_->all()[i].value).sub_(gradient, kStep);
  }
  const double change = Loss(weights).total.item<double>() - loss.total.item<double>();
  // float32 and the curvature over the step.
  EXPECT_NEAR(change / (-kStep * slope), 1.0, 0.1);
}

}  // namespace
}  // namespace vgtw
