// SPDX-License-Identifier: BSD-3-Clause
#include "network/training_log.h"

#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <filesystem>

#include <gtest/gtest.h>

namespace vgtw {
namespace {

class TrainingLogTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "log.jsonl";
};

TEST_F(TrainingLogTest, IsReadBackBitByBit) {
  TrainingStep step;
  step.step = 7;
  step.learning_rate = 1.0 / 3.0;
  step.loss = -0.1;
  for (size_t i = 0; i < kNumTrainingLosses; ++i) {
    step.losses[i] = 1e-17 / static_cast<double>(i + 3);
  }
  ValidationScore score;
  score.step = 8;
  score.mask_iou = 1.0 / 7.0;
  score.confidence_ratio = 1.0 / 11.0;
  WriteFileAtomically(path_, LogLine(step) + "\n" + LogLine(score) + "\n");
  const TrainingLog log = ReadTrainingLog(path_);
  ASSERT_EQ(log.steps.size(), 1u);
  EXPECT_EQ(log.steps[0].step, step.step);
  EXPECT_EQ(log.steps[0].learning_rate, step.learning_rate);
  EXPECT_EQ(log.steps[0].loss, step.loss);
  EXPECT_EQ(log.steps[0].losses, step.losses);
  ASSERT_EQ(log.validations.size(), 1u);
  EXPECT_EQ(LogLine(log.validations[0]), LogLine(score));
}

TEST_F(TrainingLogTest, LosesWhatCameAfterTheState) {
  WriteFileAtomically(path_,
                      "{\"step\":0,\"loss\":1}\n{\"step\":1,\"loss\":1}\n"
                      "{\"step\":2,\"mask_f1\":0.5}\n{\"step\":2,\"loss\":1}\n"
                      "{\"step\":3,\"mask_f1\":0.5}\n{\"step\":3,\"lo");
  const TrainingLog log = CutLog(path_, 2);
  EXPECT_EQ(ReadFile(path_),
            "{\"step\":0,\"loss\":1}\n{\"step\":1,\"loss\":1}\n{\"step\":2,\"mask_f1\":0.5}\n");
  EXPECT_EQ(log.steps.size(), 2u);
  ASSERT_EQ(log.validations.size(), 1u);
  EXPECT_EQ(log.validations[0].mask_f1, 0.5);
}

TEST_F(TrainingLogTest, WithoutAFileIsEmpty) {
  EXPECT_TRUE(CutLog(path_, 5).steps.empty());
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(TrainingLogTest, LinesOfOtherKindsArePassedOver) {
  WriteFileAtomically(path_, "\n[]\n{\"step\":\"1\"}\n{\"loss\":1}\nxyz\n{\"step\":0}\n");
  const TrainingLog log = ReadTrainingLog(path_);
  ASSERT_EQ(log.steps.size(), 1u);
  EXPECT_EQ(log.steps[0].loss, 0.0);
}

}  // namespace
}  // namespace vgtw
