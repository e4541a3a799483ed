// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/network_program.h"

#include "plugin/commands.h"
#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/bytes.h"
#include "tests/support/temporary_folder.h"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

int RunWith(std::vector<std::string> words) {
  words.insert(words.begin(), "vgtw");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  return RunProgram(Commands(), static_cast<int>(argv.size()), argv.data());
}

// A PATH of one folder, in which a stand-in for the network's program tells what it is given.
class NetworkProgramTest : public testing::Test {
 protected:
  void SetUp() override { ::setenv("PATH", folder_.path().c_str(), /*overwrite=*/1); }
  void TearDown() override { ::setenv("PATH", path_.c_str(), 1); }

  void Install() const {
    const fs::path program = folder_ / "vgtw-network";
    WriteFileAtomically(program, "#!/bin/sh\necho \"$# arguments: $*\" >&2\nexit 7\n");
    fs::permissions(program, fs::perms::owner_all);
  }

  const TemporaryFolder folder_;

 private:
  const std::string path_ = std::getenv("PATH");
};

TEST_F(NetworkProgramTest, IsFoundOnPath) {
  EXPECT_EQ(FindNetworkProgram(), "");
  Install();
  EXPECT_EQ(FindNetworkProgram(), folder_ / "vgtw-network");
}

TEST_F(NetworkProgramTest, MissingOneIsOneLineThatSaysWhatToInstall) {
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"predict", "--image_path", "a"}, {"weights", "inspect", "--help"}, {"predict"}}) {
    testing::internal::CaptureStderr();
    EXPECT_EQ(RunWith(words), 1);
    const std::string text = testing::internal::GetCapturedStderr();
    EXPECT_THAT(text, testing::StartsWith("vgtw " + words[0]));
    EXPECT_THAT(text, HasSubstr("vgtw-network is not installed"));
    EXPECT_THAT(text, HasSubstr("apt-get install libtorch-dev"));
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  }
}

using NetworkProgramDeathTest = NetworkProgramTest;

TEST_F(NetworkProgramDeathTest, GetsTheWholeCommandLineAndGivesItsExitCode) {
  testing::FLAGS_gtest_death_test_style = "fast";
  Install();
  EXPECT_EXIT(RunWith({"predict", "--image_path", "a b", "--help"}),
              testing::ExitedWithCode(7),
              "4 arguments: predict --image_path a b --help");
  EXPECT_EXIT(RunWith({"weights", "check", "--version"}),
              testing::ExitedWithCode(7),
              "3 arguments: weights check --version");
  // What is nobody's command stays here.
  EXPECT_EQ(RunWith({"weights", "chek"}), 2);
  EXPECT_EQ(RunWith({"weights"}), 2);
}

TEST_F(NetworkProgramTest, KeepsWhatTheUserSetInTheEnvironment) {
  ::setenv("OPENBLAS_CORETYPE", "Haswell", 1);
  PrepareNetworkEnvironment();
  EXPECT_STREQ(std::getenv("OPENBLAS_CORETYPE"), "Haswell");
  ::unsetenv("OPENBLAS_CORETYPE");
  PrepareNetworkEnvironment();
  const char* core = std::getenv("OPENBLAS_CORETYPE");
#if defined(__x86_64__)
  // Where these instructions are missing, the wrong kernels would end the process.
  const bool may_set = __builtin_cpu_supports("avx512dq") && __builtin_cpu_is("intel");
  EXPECT_TRUE(may_set || core == nullptr);
#endif
  EXPECT_STREQ(core != nullptr ? core : "SKYLAKEX", "SKYLAKEX");
  ::unsetenv("OPENBLAS_CORETYPE");
}

TEST_F(NetworkProgramTest, ThreadsSpinShortlyUnlessTheUserSaysHow) {
  ::setenv("OMP_WAIT_POLICY", "active", 1);
  ::unsetenv("GOMP_SPINCOUNT");
  PrepareNetworkEnvironment();
  EXPECT_EQ(std::getenv("GOMP_SPINCOUNT"), nullptr);
  ::unsetenv("OMP_WAIT_POLICY");
  PrepareNetworkEnvironment();
  EXPECT_STREQ(std::getenv("GOMP_SPINCOUNT"), "20000");
  ::setenv("GOMP_SPINCOUNT", "7", 1);
  PrepareNetworkEnvironment();
  EXPECT_STREQ(std::getenv("GOMP_SPINCOUNT"), "7");
  ::unsetenv("GOMP_SPINCOUNT");
}

}  // namespace
}  // namespace vgtw
