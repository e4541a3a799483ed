// SPDX-License-Identifier: BSD-3-Clause
// `vgtw train` as its users treat it.
#include "scene/files.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class TrainCommand : public testing::Test {
 protected:
  // A network of four small layers, one step in some 50 ms.
  void WriteConfig(int num_steps, const std::string& save_every_sec = "0.001") const {
    WriteFileAtomically(config_,
                        "trains = \"all\"\n"
                        "dim = 16\ndepth = 4\nheads = 2\nencoder_depth = 0\n"
                        "camera_heads = 2\ncamera_blocks = 1\nhead_layers = [0, 1, 2, 3]\n"
                        "dpt_features = 8\ndpt_channels = [8, 8, 8, 8]\n"
                        "point_head = 0\ndistractor_head = 1\n"
                        "width = 42\nheight = 28\nmax_views = 3\nsamples_per_step = 2\n"
                        "mask_weight = 1\nsuppression_weight = 0.1\nconsistency_weight = 0.1\n"
                        "camera_weight = 1\ndepth_weight = 1\ncorrespondence_weight = 0.1\n"
                        "ema_decay = 0.9\nvalidate_every = 10\nvalidation_scenes = 2\n"
                        "save_every_sec = " +
                            save_every_sec + "\nsteps = " + std::to_string(num_steps) + "\n");
  }

  std::vector<std::string> Arguments(const fs::path& run) const {
    return {"train", "--config", config_.string(), "--output_path", run.string(), "--threads", "2"};
  }

  // Starts a run in the folder of this name and signals all its processes after some ten steps.
  void StartAndSignal(const std::string& name, const std::string& signal) const {
    std::string command;
    for (const std::string& argument : Arguments(folder_ / name)) command += " '" + argument + "'";
    const std::string log = (folder_ / name / "log.jsonl").string();
    const std::string said = (folder_ / (name + ".txt")).string();
    WriteFileAtomically(folder_ / "signal.sh",
                        "setsid " VGTW_PROGRAM + command + " >'" + said +
                            "' 2>&1 & pid=$!\n"
                            "for i in $(seq 1200); do\n"
                            "  [ \"$(cat '" +
                            log +
                            "' 2>/dev/null | wc -l)\" -ge 12 ] && break\n"
                            "  sleep 0.05\n"
                            "done\n"
                            "kill " +
                            signal + " -- -$pid && wait $pid; true\n");
    ASSERT_EQ(std::system(("bash '" + (folder_ / "signal.sh").string() + "'").c_str()), 0);
  }

  const TemporaryFolder folder_;
  const fs::path config_ = folder_ / "small.conf";
};

TEST_F(TrainCommand, KilledRunGoesOnAsIfNothingHadHappened) {
  WriteConfig(40);
  ASSERT_EQ(RunVgtw(Arguments(folder_ / "whole")).exit_code, 0);
  StartAndSignal("killed", "-9");
  ASSERT_TRUE(fs::exists(folder_ / "killed" / "state.safetensors"));
  ASSERT_FALSE(fs::exists(folder_ / "killed" / "weights.safetensors")) << "it was not killed";
  const ColmapRun resumed = RunVgtw(Arguments(folder_ / "killed"));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.output;
  for (const char* name : {"log.jsonl", "weights.safetensors", "curves.svg"}) {
    EXPECT_TRUE(ReadFile(folder_ / "whole" / name) == ReadFile(folder_ / "killed" / name)) << name;
  }
}

TEST_F(TrainCommand, StoppedRunKeepsEveryStep) {
  WriteConfig(80, /*save_every_sec=*/"1e9");
  StartAndSignal("stopped", "-TERM");
  const std::string said = ReadFile(folder_ / "stopped.txt");
  EXPECT_THAT(said, HasSubstr("of 80 steps, which are saved in"));
  const std::string log = ReadFile(folder_ / "stopped" / "log.jsonl");
  ASSERT_FALSE(fs::exists(folder_ / "stopped" / "weights.safetensors"));
  const ColmapRun resumed = RunVgtw(Arguments(folder_ / "stopped"));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.output;
  EXPECT_TRUE(ReadFile(folder_ / "stopped" / "log.jsonl").starts_with(log));
}

TEST_F(TrainCommand, TellsOfAllItsValidationsAndDrawsThem) {
  WriteConfig(20);
  std::vector<std::string> arguments = Arguments(folder_ / "run");
  const std::string json = (folder_ / "summary.json").string();
  arguments.insert(arguments.end(), {"--json", json});
  const ColmapRun run = RunVgtw(arguments);
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("curves.svg"));
  const auto summary = ReadJson(json);
  ASSERT_EQ(summary.at("validations").size(), 2u);
  EXPECT_EQ(summary.at("validations")[0].at("step"), 10);
  const std::string curves = ReadFile(folder_ / "run" / "curves.svg");
  for (const char* title : {"correspondence loss", "held out: mask IoU", "learning rate"}) {
    EXPECT_THAT(curves, HasSubstr(title));
  }
}

TEST_F(TrainCommand, PointsWithoutTheirHeadAreNoted) {
  WriteConfig(1);
  std::vector<std::string> arguments = Arguments(folder_ / "run");
  arguments.insert(arguments.end(), {"--points_weight", "1"});
  const ColmapRun run = RunVgtw(arguments);
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, HasSubstr("--point_head 1"));
}

}  // namespace
}  // namespace vgtw
