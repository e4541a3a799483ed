// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/workspace.h"

#include "scene/error.h"
#include "scene/files.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

namespace vgtw {
namespace {

using nlohmann::json;

// Runs two stages, the second of which depends on the first, and counts how often each worked.
struct TwoStages {
  std::filesystem::path folder;
  int num_first = 0;
  int num_second = 0;

  json Run(const json& first_inputs, bool overwrite = false, bool force = false) {
    Workspace workspace(folder, overwrite, force);
    workspace.RunStage("first", first_inputs, folder / "a", [&] {
      ++num_first;
      WriteFileAtomically(folder / "a", "a");
      return json{{"n", num_first}};
    });
    return workspace.RunStage("second", json::object(), folder / "b", [&] {
      ++num_second;
      WriteFileAtomically(folder / "b", "b");
      return json{{"n", num_second}};
    });
  }
};

TEST(Workspace, SkipsWhatIsUpToDateAndReturnsItsResult) {
  const TemporaryFolder folder;
  TwoStages stages{folder / "out"};
  EXPECT_EQ(stages.Run({{"x", 1}}), (json{{"n", 1}}));
  EXPECT_EQ(stages.Run({{"x", 1}}), (json{{"n", 1}}));
  EXPECT_EQ(stages.num_first, 1);
  EXPECT_EQ(stages.num_second, 1);
}

TEST(Workspace, RefusesOtherInputsUnlessOverwriting) {
  const TemporaryFolder folder;
  TwoStages stages{folder / "out"};
  stages.Run({{"x", 1}});
  const auto before = Snapshot(folder.path());
  EXPECT_THROW(stages.Run({{"x", 2}}), Error);
  EXPECT_EQ(Snapshot(folder.path()), before);
  stages.Run({{"x", 2}}, /*overwrite=*/true);
  // The second stage has the same inputs, but what it builds on has changed.
  EXPECT_EQ(stages.num_first, 2);
  EXPECT_EQ(stages.num_second, 2);
}

TEST(Workspace, RepeatsWhenForcedOrWhenTheOutputIsGone) {
  const TemporaryFolder folder;
  TwoStages stages{folder / "out"};
  stages.Run({{"x", 1}});
  stages.Run({{"x", 1}}, /*overwrite=*/false, /*force=*/true);
  EXPECT_EQ(stages.num_first, 2);
  std::filesystem::remove(folder / "out/b");
  stages.Run({{"x", 1}});
  EXPECT_EQ(stages.num_first, 2);
  EXPECT_EQ(stages.num_second, 3);
}

TEST(Workspace, ForgetsAStageThatFailed) {
  const TemporaryFolder folder;
  const auto run = [&](bool fails) {
    Workspace workspace(folder / "out", /*overwrite=*/false, /*force=*/false);
    return workspace.RunStage("only", json::object(), folder / "out/a", [&] {
      WriteFileAtomically(folder / "out/a", "half");
      if (fails) throw Error("broken");
      return json(5);
    });
  };
  EXPECT_THROW(run(true), Error);
  EXPECT_EQ(run(false), json(5));
}

TEST(Workspace, LeavesForeignFoldersAlone) {
  const TemporaryFolder folder;
  WriteFileAtomically(folder / "thesis.tex", "dear reader");
  const auto before = Snapshot(folder.path());
  EXPECT_THROW(Workspace(folder.path(), true, true), Error);
  WriteFileAtomically(folder / "run.json", "{\"format\": \"another\"}");
  EXPECT_THROW(Workspace(folder.path(), true, true), Error);
  std::filesystem::remove(folder / "run.json");
  EXPECT_EQ(Snapshot(folder.path()), before);
}

TEST(Workspace, DamagedRecordIsAnError) {
  const TemporaryFolder folder;
  for (const char* text : {"", "{", "[]", "{\"format\": 3}", "{\"format\": \"vgtw-run\", "}) {
    WriteFileAtomically(folder / "run.json", text);
    EXPECT_THROW(Workspace(folder.path(), false, false), Error) << text;
  }
}

}  // namespace
}  // namespace vgtw
