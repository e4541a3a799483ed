// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/flags.h"

#include "scene/error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

struct Outcome {
  int exit_code = 0;
  std::string stdout_text;
  std::string stderr_text;
};

struct Values {
  std::filesystem::path input_path;
  std::string kind = "round";
  int count = 3;
  double share = 0.5;
  bool overwrite = false;
  bool was_run = false;
};

Outcome RunWith(std::vector<std::string> words, Values& values, std::function<void()> work = {}) {
  const DeclareCommand declare = [&](Flags& flags) {
    flags.Group("Input")
        .Require("input_path", &values.input_path, "What to read")
        .AddChoice("kind", &values.kind, {"round", "square"}, "Its shape");
    flags.Group("Algorithm")
        .Add("count", &values.count, "How many")
        .Add("share", &values.share, "How much, in (0,1]")
        .Add("overwrite", &values.overwrite, "Replace");
    return [&] {
      values.was_run = true;
      if (work) work();
    };
  };
  const std::vector<Command> commands = {{"seed", "Makes a model", declare, "  vgtw seed x"},
                                         {"mask apply", "Masks a database", declare}};
  words.insert(words.begin(), "vgtw");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.exit_code = RunProgram(commands, static_cast<int>(argv.size()), argv.data());
  outcome.stdout_text = testing::internal::GetCapturedStdout();
  outcome.stderr_text = testing::internal::GetCapturedStderr();
  return outcome;
}

TEST(Flags, SetValuesAndRunTheCommand) {
  Values values;
  const Outcome outcome = RunWith(
      {"mask", "apply", "--input_path", "a b", "--count", "7", "--share=0.25", "--overwrite"},
      values);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.stderr_text;
  EXPECT_TRUE(values.was_run);
  EXPECT_EQ(values.input_path, "a b");
  EXPECT_EQ(values.count, 7);
  EXPECT_EQ(values.share, 0.25);
  EXPECT_TRUE(values.overwrite);
}

TEST(Flags, SwitchesAlsoTakeColmapsZeroAndOne) {
  Values values;
  values.overwrite = true;
  EXPECT_EQ(RunWith({"seed", "--input_path", "a", "--overwrite", "0"}, values).exit_code, 0);
  EXPECT_FALSE(values.overwrite);
  EXPECT_EQ(RunWith({"seed", "--overwrite", "1", "--input_path", "a"}, values).exit_code, 0);
  EXPECT_TRUE(values.overwrite);
}

TEST(Flags, HelpShowsGroupsDefaultsAndExamples) {
  Values values;
  const Outcome outcome = RunWith({"seed", "--help"}, values);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_FALSE(values.was_run);
  for (const char* text :
       {"Input", "Algorithm", "--count", "3", "0.5", "round", "REQUIRED", "vgtw seed x"}) {
    EXPECT_THAT(outcome.stdout_text, HasSubstr(text));
  }
  EXPECT_THAT(RunWith({"--help"}, values).stdout_text, HasSubstr("vgtw doctor"));
}

TEST(Flags, WrongUsageExitsWithTwoInOneLine) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{}, "A command is required"},
      {{"sed"}, "did you mean 'seed'"},
      {{"mask"}, "A command is required"},
      {{"mask", "aply"}, "did you mean 'apply'"},
      {{"seed"}, "--input_path is required"},
      {{"seed", "--input_path"}, "--input_path"},
      {{"seed", "--input_path", "a", "--conut", "3"}, "did you mean '--count'"},
      {{"seed", "--input_path", "a", "--count", "many"}, "--count"},
      {{"seed", "--input_path", "a", "--share", "1e999x"}, "--share"},
      {{"seed", "--input_path", "a", "--kind", "flat"}, "flat"},
      {{"seed", "--input_path", "a", "stray"}, "unknown argument 'stray'"}};
  for (const auto& [words, expected] : cases) {
    Values values;
    const Outcome outcome = RunWith(words, values);
    EXPECT_EQ(outcome.exit_code, 2) << expected;
    EXPECT_FALSE(values.was_run);
    EXPECT_THAT(outcome.stderr_text, HasSubstr(expected));
    EXPECT_EQ(std::count(outcome.stderr_text.begin(), outcome.stderr_text.end(), '\n'), 1)
        << outcome.stderr_text;
  }
}

TEST(Flags, FailuresExitWithOneAndNameTheCommand) {
  Values values;
  const auto fail = [] { throw Error("a.db: is not a database, expected one"); };
  const Outcome outcome = RunWith({"mask", "apply", "--input_path", "a"}, values, fail);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(outcome.stderr_text, "vgtw mask apply: a.db: is not a database, expected one\n");
  const auto crash = [] { throw std::runtime_error("oops"); };
  EXPECT_THAT(RunWith({"seed", "--input_path", "a"}, values, crash).stderr_text,
              HasSubstr("internal error: oops"));
  const auto bounds = [] { VGTW_CHECK(1 < 0, "SeedOptions::keep_percent = 0, must be > 0"); };
  EXPECT_THAT(RunWith({"seed", "--input_path", "a"}, values, bounds).stderr_text,
              HasSubstr("keep_percent"));
}

}  // namespace
}  // namespace vgtw
