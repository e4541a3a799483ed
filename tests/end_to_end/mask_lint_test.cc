// SPDX-License-Identifier: BSD-3-Clause
#include "bridge/mask_lint.h"

#include "scene/distractor_mask.h"
#include "scene/image_io.h"
#include "tests/end_to_end/run_vgtw.h"
#include "tests/support/temporary_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::HasSubstr;

class MaskLintCommand : public testing::Test {
 protected:
  MaskLintCommand() {
    StaticMask static_mask(8, 4, 255);
    for (int x = 0; x < 8; ++x) static_mask(x, 2) = 0;
    WriteImage(folder_ / "photos/a b.jpg", GrayImage(8, 4, 90));
    WriteImage(folder_ / "photos/c.jpg", GrayImage(8, 4, 90));
    WriteImage(folder_ / "masks/a b.png", static_mask);
    static_mask(0, 0) = 0;
    WriteImage(folder_ / "masks/c.jpg.png", static_mask);
  }

  // --colmap_version, so that the result does not depend on what is installed.
  ColmapRun Lint(const std::string& version, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> args = {"mask",
                                     "lint",
                                     "--image_path",
                                     (folder_ / "photos").string(),
                                     "--mask_path",
                                     (folder_ / "masks").string(),
                                     "--colmap_version",
                                     version};
    args.insert(args.end(), more.begin(), more.end());
    return RunVgtw(args);
  }

  const TemporaryFolder folder_;
};

TEST_F(MaskLintCommand, ErrorsFailAndNotesDoNot) {
  const ColmapRun old = Lint("3.8");
  EXPECT_EQ(old.exit_code, 1);
  EXPECT_THAT(old.output, HasSubstr("error name-without-extension: "));
  EXPECT_THAT(old.output, HasSubstr("\n  a b.jpg: a b.png\n"));
  EXPECT_THAT(old.output, HasSubstr("uses the whole photo"));
  EXPECT_THAT(old.output, HasSubstr("keeps 71.88 %"));  // 23 of 32 pixels
  EXPECT_THAT(old.output, HasSubstr("1 error, 0 warnings, 0 notes in "));
  const ColmapRun recent = Lint("3.13");
  EXPECT_EQ(recent.exit_code, 0) << recent.output;
  EXPECT_THAT(recent.output, HasSubstr("note name-needs-newer: "));
  EXPECT_THAT(recent.output, HasSubstr("0 errors, 0 warnings, 1 note\n"));
}

TEST_F(MaskLintCommand, FixMendsAndReportsInJson) {
  const std::string fixed = (folder_ / "fixed").string();
  const std::string json_path = (folder_ / "lint.json").string();
  const ColmapRun run = Lint("3.8", {"--fix", fixed, "--json", json_path});
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("  a b.jpg: renamed from a b.png\n"));
  EXPECT_DOUBLE_EQ(ExcludedShare(ReadStaticMask(folder_ / "fixed/a b.jpg.png")), 0.25);
  const auto json = ReadJson(json_path);
  EXPECT_EQ(json.at("num_errors"), 1);
  EXPECT_EQ(json.at("images")[0].at("effect"), "unused");
  EXPECT_EQ(json.at("findings")[0].at("code"), "name-without-extension");
  EXPECT_EQ(json.at("fix").at("report").at("num_errors"), 0);
  // An existing folder is not replaced unasked.
  EXPECT_EQ(Lint("3.8", {"--fix", fixed}).exit_code, 1);
  EXPECT_EQ(Lint("3.8", {"--fix", fixed, "--overwrite"}).exit_code, 0);
}

TEST_F(MaskLintCommand, WhatCannotBeMendedIsNamed) {
  WriteImage(folder_ / "masks/c.jpg.png", StaticMask(9, 8, 0));
  const ColmapRun run = Lint("3.8", {"--fix", (folder_ / "fixed").string()});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.output, HasSubstr("NOT MENDED c.jpg: all-white instead: "));
  EXPECT_THAT(run.output, HasSubstr("1 mask could not be mended"));
}

TEST_F(MaskLintCommand, WrongUseIsOneLine) {
  EXPECT_THAT(Lint("2").output, HasSubstr("COLMAP version '2', expected 3.8 or newer"));
  EXPECT_THAT(Lint("3.8", {"--invert"}).output, HasSubstr("are for --fix"));
  const ColmapRun no_colmap =
      RunVgtw({"mask", "lint", "--image_path", "x", "--mask_path", "y", "--colmap", "/no/colmap"});
  EXPECT_EQ(no_colmap.exit_code, 1);
  EXPECT_THAT(no_colmap.output, HasSubstr("no such executable"));
}

}  // namespace
}  // namespace vgtw
