// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_state.h"

#include "scene/error.h"
#include "scene/files.h"
#include "scene/safetensors.h"
#include "tests/network/tiny_training.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>
#include <string>

#include <ATen/ATen.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

struct SmallRun {
  TrainedParameters parameters;
  AdamW optimiser;

  explicit SmallRun(uint64_t seed)
      : parameters(TrainableNetwork(), nullptr, TrainedParts::kAll, seed, at::Device(at::kCPU)),
        optimiser(parameters, {.ema_decay = 0.9}) {}

  void Step() {
    std::vector<at::Tensor> gradients;
    for (const TrainedParameter& parameter : parameters.all()) {
      gradients.push_back(at::sin(parameter.value * 10.0));
    }
    optimiser.Step(std::move(gradients), 0, 1e-2);
  }
};

class TrainingState : public testing::Test {
 protected:
  TemporaryFolder folder_;
};

TEST_F(TrainingState, IsReadBackBitByBit) {
  const std::filesystem::path path = folder_ / "state.safetensors";
  SmallRun run(1);
  run.Step();
  WriteTrainingState(path, run.parameters, run.optimiser.moments(), 17, "options");
  SmallRun other(2);
  EXPECT_EQ(ReadTrainingState(path, "options", other.parameters, other.optimiser.moments()), 17);
  for (size_t i = 0; i < run.parameters.all().size(); ++i) {
    EXPECT_TRUE(at::equal(run.parameters.all()[i].value, other.parameters.all()[i].value));
    const AdamW::Moments& ours = run.optimiser.moments();
    const AdamW::Moments& theirs = other.optimiser.moments();
    EXPECT_TRUE(at::equal(ours.first[i], theirs.first[i]));
    EXPECT_TRUE(at::equal(ours.second[i], theirs.second[i]));
    EXPECT_TRUE(at::equal(ours.mean[i], theirs.mean[i]));
  }
}

TEST_F(TrainingState, ThatIsMissingIsNone) {
  SmallRun run(1);
  EXPECT_FALSE(
      ReadTrainingState(folder_ / "none", "options", run.parameters, run.optimiser.moments()));
}

TEST_F(TrainingState, OfOtherOptionsIsRefused) {
  const std::filesystem::path path = folder_ / "state.safetensors";
  SmallRun run(1);
  WriteTrainingState(path, run.parameters, run.optimiser.moments(), 17, "options");
  EXPECT_THROW(ReadTrainingState(path, "others", run.parameters, run.optimiser.moments()), Error);
}

TEST_F(TrainingState, ThatIsTruncatedIsRefused) {
  const std::filesystem::path path = folder_ / "state.safetensors";
  SmallRun run(1);
  WriteTrainingState(path, run.parameters, run.optimiser.moments(), 17, "options");
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 4);
  EXPECT_THROW(ReadTrainingState(path, "options", run.parameters, run.optimiser.moments()), Error);
}

TEST_F(TrainingState, ThatLacksATensorChangesNothing) {
  const std::filesystem::path path = folder_ / "state.safetensors";
  SmallRun run(1);
  WriteTrainingState(path, run.parameters, run.optimiser.moments(), 17, "options");
  {
    const SafetensorsFile file(path);
    StoredTensors tensors = file.tensors();
    tensors.erase("second." + run.parameters.all().back().name);
    WriteSafetensors(path, tensors, file.metadata());
  }
  SmallRun other(2);
  const at::Tensor before = other.parameters.all()[0].value.clone();
  EXPECT_THROW(ReadTrainingState(path, "options", other.parameters, other.optimiser.moments()),
               Error);
  EXPECT_TRUE(at::equal(before, other.parameters.all()[0].value));
}

}  // namespace
}  // namespace vgtw
