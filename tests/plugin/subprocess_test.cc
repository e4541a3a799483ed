// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/subprocess.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

SubprocessResult RunShell(const std::string& script, const std::filesystem::path& log = {}) {
  return RunSubprocess("/bin/sh", {"-c", script}, log);
}

TEST(Subprocess, GathersBothOutputsAndTheExitCode) {
  const SubprocessResult result = RunShell("echo one; echo two >&2; printf three; exit 7");
  EXPECT_EQ(result.output, "one\ntwo\nthree");
  EXPECT_EQ(result.exit_code, 7);
}

TEST(Subprocess, NamesTheSignalThatEndedIt) {
  EXPECT_EQ(RunShell("kill -ABRT $$").exit_code, 128 + 6);
}

TEST(Subprocess, HasNoStandardInput) { EXPECT_EQ(RunShell("cat; echo end").output, "end\n"); }

TEST(Subprocess, PassesLinesAsTheyCome) {
  std::vector<std::string> lines;
  RunSubprocess("/bin/sh", {"-c", "echo a; echo; echo b"}, {}, [&](const std::string& line) {
    lines.push_back(line);
  });
  EXPECT_EQ(lines, (std::vector<std::string>{"a", "", "b"}));
}

TEST(Subprocess, AppendsCommandAndOutputToTheLog) {
  const TemporaryFolder folder;
  RunShell("echo one", folder / "log");
  RunShell("echo two", folder / "log");
  EXPECT_EQ(ReadFile(folder / "log"),
            "$ /bin/sh -c 'echo one'\none\n$ /bin/sh -c 'echo two'\ntwo\n");
}

TEST(Subprocess, KeepsTheEndOfLongOutput) {
  const SubprocessResult result = RunShell("yes 0123456789 | head -100000; echo end");
  EXPECT_LE(result.output.size(), size_t{256} * 1024);
  EXPECT_THAT(result.output, testing::EndsWith("0123456789\nend\n"));
}

TEST(Subprocess, MissingExecutableIsAnError) {
  EXPECT_THROW(RunSubprocess("/nonexistent/colmap", {}), Error);
  EXPECT_EQ(FindExecutable("/nonexistent/colmap"), "");
  EXPECT_EQ(FindExecutable("no-such-program-anywhere"), "");
  EXPECT_EQ(FindExecutable("sh").filename(), "sh");
}

TEST(ShellLine, CanBePastedIntoAShell) {
  const std::vector<std::string> words = {"plain", "two words", "it's", "", "$HOME;*"};
  EXPECT_EQ(
      RunShell(ShellLine("/usr/bin/printf", {"%s|", "two words", "it's", "", "$HOME;*"})).output,
      "two words|it's||$HOME;*|");
  EXPECT_EQ(ShellLine("colmap", words), "colmap plain 'two words' 'it'\\''s' '' '$HOME;*'");
}

}  // namespace
}  // namespace vgtw
