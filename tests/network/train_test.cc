// SPDX-License-Identifier: BSD-3-Clause
#include "network/train.h"

#include "network/checkpoint.h"
#include "network/scene_samples.h"
#include "network/validation.h"
#include "network/weights.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/network/tiny_training.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;

struct Stopped {};

TEST(Train, StoppedRunEndsWithTheSameBits) {
  const TemporaryFolder folder;
  TrainOptions options = ShortRun(/*lora_only=*/false);
  options.ema_decay = 0.9;
  Train(options, folder / "whole");
  options.save_every_sec = 1e-9;
  const auto stop = [](int64_t done, int64_t) {
    if (done == 4) throw Stopped();
  };
  EXPECT_THROW(Train(options, folder / "stopped", stop), Stopped);
  Train(options, folder / "stopped");
  for (const char* name : {"weights.safetensors", "log.jsonl"}) {
    EXPECT_TRUE(ReadFile(folder / "whole" / name) == ReadFile(folder / "stopped" / name)) << name;
  }
}

TEST(Train, WritesLoraAndHeadThatLoadOverTheirBase) {
  const TemporaryFolder folder;
  TrainOptions options = ShortRun(/*lora_only=*/false);
  options.num_steps = 1;
  Train(options, folder / "base");
  TrainOptions extension = ShortRun(/*lora_only=*/true);
  extension.weights = {folder / "base" / "weights.safetensors"};
  extension.num_steps = 2;
  Train(extension, folder / "lora");
  const fs::path lora = folder / "lora" / "weights.safetensors";
  const Checkpoint written(lora);
  for (const auto& [name, tensor] : written.tensors()) {
    EXPECT_TRUE(name.starts_with("mask_head.") || name.find(".attn.lora_") != std::string::npos)
        << name;
  }
  const LoadedNetwork network = LoadNetwork({extension.weights.front(), lora}, {});
  EXPECT_EQ(network.description.kind, NetworkKind::kVgtw);
  EXPECT_EQ(network.description.side_px, options.scenes.width);
  const auto& config = std::get<VggtConfig>(network.description.config);
  EXPECT_EQ(config.lora->rank, 2);
  EXPECT_EQ(config.num_camera_heads, 2);
  EXPECT_EQ(config.num_camera_blocks, 1);
  EXPECT_FALSE(config.has_point_head);
}

TEST(Train, HeadHasARateOfItsOwn) {
  const TemporaryFolder folder;
  TrainOptions base = ShortRun(/*lora_only=*/false);
  base.num_steps = 1;
  Train(base, folder / "base");
  TrainOptions options = ShortRun(/*lora_only=*/true);
  options.weights = {folder / "base" / "weights.safetensors"};
  options.num_steps = 1;
  options.warmup_share = options.decay_share = 0.0;
  Train(options, folder / "one_rate");
  options.head_learning_rate = 2.0 * options.learning_rate;
  Train(options, folder / "two_rates");
  const Checkpoint one_rate(folder / "one_rate" / "weights.safetensors");
  const Checkpoint two_rates(folder / "two_rates" / "weights.safetensors");
  bool moved_head = false;
  for (const auto& [name, tensor] : one_rate.tensors()) {
    const bool is_equal = std::ranges::equal(tensor.bytes, two_rates.tensors().at(name).bytes);
    if (name.starts_with("mask_head.")) {
      moved_head |= !is_equal;
    } else {
      EXPECT_TRUE(is_equal) << name;
    }
  }
  EXPECT_TRUE(moved_head);
}

TEST(Train, LowersTheLossOfANewNetwork) {
  const TemporaryFolder folder;
  TrainOptions options = ShortRun(/*lora_only=*/false);
  options.num_steps = 60;
  options.learning_rate = 3e-3;
  options.validate_every = 60;
  options.num_validation_scenes = 8;
  options.save_every_sec = 1e9;
  TrainOptions untrained = options;
  untrained.num_steps = 1;
  untrained.learning_rate = 1e-12;
  untrained.warmup_share = untrained.decay_share = 0.0;
  const ValidationScore before = Train(untrained, folder / "before").validations.back();
  const ValidationScore after = Train(options, folder / "after").validations.back();
  EXPECT_LT(after.abs_rel, before.abs_rel);
  EXPECT_LT(after.rotation_deg, before.rotation_deg + 1.0);
}

// A LoRA and a distractor head learn two scenes by heart, on weights that have learnt nothing.
TEST(Train, OverfitsMasksOfTwoScenes) {
  const TemporaryFolder folder;
  TrainOptions base = ShortRun(/*lora_only=*/false);
  base.sizes.dim = 32;
  base.sizes.dpt = {.num_features = 16, .num_channels = {16, 16, 32, 32}};
  base.num_steps = 1;
  base.num_validation_scenes = 0;
  Train(base, folder / "base");
  TrainOptions options = base;
  options.lora_only = true;
  options.weights = {folder / "base" / "weights.safetensors"};
  options.lora = {.rank = 8, .alpha = 16.0};
  options.lora_dropout = 0.0;
  options.loss_weights = {1.0, 0.01, 0.05};
  options.scene_kind = SceneKind::kDemo;
  options.num_scenes = 2;
  options.scenes.width = 56;
  options.scenes.height = 42;
  options.scenes.min_views = options.scenes.max_views = 3;
  options.num_steps = 500;
  options.learning_rate = 5e-3;
  options.num_threads = 0;
  Train(options, folder / "lora");
  const LoadedNetwork network =
      LoadNetwork({options.weights.front(), folder / "lora" / "weights.safetensors"}, {});
  const SceneSamples samples(options.scenes, options.scene_kind);
  const ValidationScore score =
      Summarise({ScoreSample(*network.model, samples.Get(0), options.feature_layer),
                 ScoreSample(*network.model, samples.Get(1), options.feature_layer)},
                options.num_steps);
  EXPECT_GT(score.mask_iou, 0.95);
}

TEST(Train, RefusesToGoOnWithOtherOptions) {
  const TemporaryFolder folder;
  TrainOptions options = ShortRun(/*lora_only=*/false);
  options.num_steps = 2;
  options.warmup_share = 0.0;
  Train(options, folder / "run");
  options.learning_rate *= 2.0;
  EXPECT_THROW(Train(options, folder / "run"), Error);
  const std::string weights = ReadFile(folder / "run" / "weights.safetensors");
  ForgetRun(folder / "run");
  EXPECT_TRUE(fs::is_empty(folder / "run"));
  Train(options, folder / "run");
  EXPECT_TRUE(ReadFile(folder / "run" / "weights.safetensors") != weights);
}

TEST(Train, RefusesToGoOnOverOtherWeights) {
  const TemporaryFolder folder;
  TrainOptions base = ShortRun(/*lora_only=*/false);
  base.num_steps = 1;
  Train(base, folder / "base");
  TrainOptions extension = ShortRun(/*lora_only=*/true);
  extension.weights = {folder / "base" / "weights.safetensors"};
  Train(extension, folder / "lora");
  ForgetRun(folder / "base");
  base.weights_seed = 5;
  Train(base, folder / "base");
  EXPECT_THROW(Train(extension, folder / "lora"), Error);
}

// The summary of a run that went on tells of all its validations.
TEST(Train, ResumedRunKnowsItsPast) {
  const TemporaryFolder folder;
  TrainOptions options = ShortRun(/*lora_only=*/false);
  options.decay_share = options.warmup_share = 0.0;  // or the rate would depend on num_steps
  options.num_steps = 3;
  Train(options, folder / "run");
  options.num_steps = 6;
  const TrainSummary summary = Train(options, folder / "run");
  ASSERT_EQ(summary.validations.size(), 2u);
  EXPECT_EQ(summary.validations[0].step, 3);
  EXPECT_EQ(summary.validations[1].step, 6);
}

TEST(Train, LossThatIsNotFiniteIsAnError) {
  const TemporaryFolder folder;
  TrainOptions options = ShortRun(/*lora_only=*/false);
  options.learning_rate = 1e30;
  options.warmup_share = 0.0;
  options.num_steps = 4;
  options.num_validation_scenes = 0;
  EXPECT_THROW(Train(options, folder / "run"), Error);
}

TEST(Train, FaultyOptionsAreNamed) {
  const auto message = [](const auto& change) -> std::string {
    TrainOptions options = ShortRun(/*lora_only=*/false);
    change(options);
    try {
      options.Check();
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "no fault";
  };
  EXPECT_EQ(message([](TrainOptions&) {}), "no fault");
  EXPECT_NE(message([](TrainOptions& o) { o.num_steps = 0; }).find("num_steps"), std::string::npos);
  EXPECT_NE(message([](TrainOptions& o) {
              o.learning_rate = std::numeric_limits<double>::quiet_NaN();
            }).find("learning_rate"),
            std::string::npos);
  EXPECT_NE(
      message([](TrainOptions& o) { o.head_learning_rate = -1.0; }).find("head_learning_rate"),
      std::string::npos);
  EXPECT_NE(message([](TrainOptions& o) { o.loss_weights[0] = -1.0; }).find("mask_weight"),
            std::string::npos);
  EXPECT_NE(message([](TrainOptions& o) { o.warmup_share = 0.9; }).find("decay_share"),
            std::string::npos);
}

}  // namespace
}  // namespace vgtw
