// SPDX-License-Identifier: BSD-3-Clause
#include "network/adamw.h"

#include "tests/network/tiny_training.h"

#include <cmath>
#include <vector>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

TEST(LearningRateSchedule, RisesStaysAndFalls) {
  const LearningRateSchedule schedule{
      .peak = 1.0, .warmup_share = 0.1, .decay_share = 0.5, .num_steps = 100};
  EXPECT_NEAR(schedule.At(0), 1e-8, 1e-15);
  EXPECT_NEAR(schedule.At(5), 0.5, 1e-8);
  EXPECT_NEAR(schedule.At(10), 1.0, 1e-12);
  EXPECT_NEAR(schedule.At(50), 1.0, 1e-12);
  EXPECT_NEAR(schedule.At(75), 0.5, 1e-7);
  EXPECT_LT(schedule.At(99), 0.002);
}

TEST(LearningRateSchedule, WithoutRiseOrFallIsThePeak) {
  const LearningRateSchedule schedule{
      .peak = 0.3, .warmup_share = 0.0, .decay_share = 0.0, .num_steps = 4};
  for (int64_t step = 0; step < 4; ++step) EXPECT_EQ(schedule.At(step), 0.3);
}

class AdamWTest : public testing::Test {
 protected:
  std::vector<at::Tensor> Gradients(double value) const {
    std::vector<at::Tensor> gradients;
    for (const TrainedParameter& parameter : parameters_.all()) {
      gradients.push_back(at::full_like(parameter.value, value));
    }
    return gradients;
  }

  TrainedParameters parameters_{
      TrainableNetwork(), nullptr, TrainedParts::kAll, 1, at::Device(at::kCPU)};
};

// The published update, one number in double.
class ReferenceAdamW {
 public:
  explicit ReferenceAdamW(double value) : value_(value) {}
  void Step(double gradient, int step, double rate, double decay) {
    first_ = 0.9 * first_ + 0.1 * gradient;
    second_ = 0.999 * second_ + 0.001 * gradient * gradient;
    const double first = first_ / (1.0 - std::pow(0.9, step));
    const double second = second_ / (1.0 - std::pow(0.999, step));
    value_ -= rate * decay * value_;
    value_ -= rate * first / (std::sqrt(second) + 1e-8);
  }
  double value() const { return value_; }

 private:
  double value_;
  double first_ = 0.0;
  double second_ = 0.0;
};

TEST_F(AdamWTest, TwoStepsAreThePublishedOnes) {
  std::vector<ReferenceAdamW> references;
  for (const TrainedParameter& parameter : parameters_.all()) {
    references.emplace_back(parameter.value.flatten()[0].item<double>());
  }
  AdamW optimiser(parameters_, {.weight_decay = 0.1, .max_group_norm = 0.0});
  optimiser.Step(Gradients(0.5), 0, 0.01);
  optimiser.Step(Gradients(-0.2), 1, 0.02);
  size_t num_decaying = 0;
  for (size_t i = 0; i < references.size(); ++i) {
    const TrainedParameter& parameter = parameters_.all()[i];
    const double decay = parameter.decays ? 0.1 : 0.0;
    num_decaying += parameter.decays;
    references[i].Step(0.5, 1, 0.01, decay);
    references[i].Step(-0.2, 2, 0.02, decay);
    // Values of about 1 in float32.
    EXPECT_NEAR(parameter.value.flatten()[0].item<double>(), references[i].value(), 5e-7)
        << parameter.name;
  }
  EXPECT_GT(num_decaying, 0u);
  EXPECT_LT(num_decaying, references.size());
}

TEST_F(AdamWTest, GroupMovesAtItsOwnRate) {
  constexpr auto kGroup = static_cast<size_t>(ParameterGroup::kHeads);
  AdamWOptions options{.weight_decay = 0.1, .max_group_norm = 0.0};
  options.rate_factors[kGroup] = 3.0;
  std::vector<ReferenceAdamW> references;
  for (const TrainedParameter& parameter : parameters_.all()) {
    references.emplace_back(parameter.value.flatten()[0].item<double>());
  }
  AdamW(parameters_, options).Step(Gradients(0.5), 0, 0.01);
  size_t num_in_group = 0;
  for (size_t i = 0; i < references.size(); ++i) {
    const TrainedParameter& parameter = parameters_.all()[i];
    const bool is_in_group = static_cast<size_t>(parameter.group) == kGroup;
    num_in_group += is_in_group;
    references[i].Step(0.5, 1, is_in_group ? 0.03 : 0.01, parameter.decays ? 0.1 : 0.0);
    EXPECT_NEAR(parameter.value.flatten()[0].item<double>(), references[i].value(), 5e-7)
        << parameter.name;
  }
  EXPECT_GT(num_in_group, 0u);
  EXPECT_LT(num_in_group, references.size());
}

TEST_F(AdamWTest, NormsOfGroupsAreThoseBeforeClipping) {
  AdamW optimiser(parameters_, {.max_group_norm = 1.0});
  double num_in_trunk = 0.0;
  for (const TrainedParameter& parameter : parameters_.all()) {
    if (parameter.group != ParameterGroup::kTrunk) continue;
    num_in_trunk += static_cast<double>(parameter.value.numel());
  }
  const AdamW::GroupNorms norms = optimiser.Step(Gradients(2.0), 0, 1e-3);
  const double norm = norms[static_cast<size_t>(ParameterGroup::kTrunk)];
  EXPECT_NEAR(norm, 2.0 * std::sqrt(num_in_trunk), 1e-3 * norm);
  // The first moment holds a tenth of the clipped gradient.
  for (size_t i = 0; i < parameters_.all().size(); ++i) {
    if (parameters_.all()[i].group != ParameterGroup::kTrunk) continue;
    EXPECT_NEAR(
        optimiser.moments().first[i].flatten()[0].item<double>(), 0.1 * 2.0 / norm, 1e-5 / norm);
  }
}

TEST_F(AdamWTest, GradientThatIsNotFiniteMovesNothing) {
  AdamW optimiser(parameters_, {});
  std::vector<at::Tensor> before;
  for (const TrainedParameter& parameter : parameters_.all()) {
    before.push_back(parameter.value.clone());
  }
  std::vector<at::Tensor> gradients = Gradients(1.0);
  gradients.back().flatten()[0] = std::nan("");
  EXPECT_FALSE(AreFinite(optimiser.Step(std::move(gradients), 0, 0.1)));
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_TRUE(at::equal(before[i], parameters_.all()[i].value));
  }
}

TEST_F(AdamWTest, MeanOfValuesFollowsThem) {
  AdamW optimiser(parameters_, {.max_group_norm = 0.0, .ema_decay = 0.5});
  const at::Tensor before = parameters_.all()[0].value.clone();
  optimiser.Step(Gradients(1.0), 0, 0.1);
  const at::Tensor after = parameters_.all()[0].value;
  // decay min(0.5, 1 / 10) in the first step
  EXPECT_TRUE(at::allclose(optimiser.moments().mean[0], 0.1 * before + 0.9 * after, 1e-6, 1e-6));
}

}  // namespace
}  // namespace vgtw
